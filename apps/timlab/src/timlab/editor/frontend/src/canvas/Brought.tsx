import { useDocument } from "../session/store";
import { openDialog } from "../ui/ui";

/** Says that the diagram brings code, of which nothing was run. */
export function Brought() {
  const foreign = useDocument((document) => document.foreign);
  if (!foreign.length) return null;
  return (
    <div className="brought" role="region" aria-label="code of the diagram">
      <span>
        The diagram brings code of its own ({foreign.map(({ path }) => path).join(", ")}). Nothing of it was run.
      </span>
      <button type="button" className="plain" onClick={() => openDialog("trust")}>
        Read it
      </button>
    </div>
  );
}
