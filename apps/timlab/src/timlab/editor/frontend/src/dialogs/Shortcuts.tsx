import { COMMANDS } from "../commands/all";
import { written } from "../commands/command";
import { Modal } from "../ui/Modal";

const GROUPS = ["File", "Edit", "Arrange", "Run", "View"] as const;

/** All keys. */
export function Shortcuts() {
  return (
    <Modal label="Keyboard shortcuts" wide>
      <div className="columns">
        {GROUPS.map((group) => (
          <section key={group}>
            <h3>{group}</h3>
            <dl className="keys">
              {COMMANDS.filter((command) => command.group === group && command.keys).map((command) => (
                <div key={command.label}>
                  <dt>{command.label}</dt>
                  <dd>
                    {command.keys!.map((keys) => (
                      <kbd key={keys}>{written(keys)}</kbd>
                    ))}
                  </dd>
                </div>
              ))}
            </dl>
          </section>
        ))}
      </div>
      <p className="quiet">
        Tab goes from block to block and selects it; Shift and click add to what is selected. Drag beside blocks to
        select, with the middle or right button, or two fingers, to move the canvas.
      </p>
    </Modal>
  );
}
