import { arrangeCommands } from "../commands/arrange";
import { editCommands } from "../commands/edit";
import { useContextOfCommands } from "../commands/useKeys";

const EDITS = ["Copy", "Duplicate", "Delete", "Make a subsystem"];

/** What can be done with several blocks. */
export function Many({ names }: { names: string[] }) {
  const context = useContextOfCommands();
  const commands = [...editCommands.filter(({ label }) => EDITS.includes(label)), ...arrangeCommands];
  return (
    <div className="form">
      <header>
        <strong>{names.length} blocks</strong>
      </header>
      <div className="actions">
        {commands.map(({ label, run }) => (
          <button key={label} type="button" className="plain" onClick={() => void run(context)}>
            {label}
          </button>
        ))}
      </div>
    </div>
  );
}
