import { useAsk } from "../session/context";
import { useDocument, useRun } from "../session/store";
import { Modal } from "../ui/Modal";
import { closeDialog } from "../ui/ui";

/** The code that a diagram brings, and whether to let it run. */
export function Trust() {
  const ask = useAsk();
  const foreign = useDocument((document) => document.foreign);
  const offered = foreign.length > 0 && foreign.every((each) => each.offered);
  const trust = async () => {
    if (!(await ask({ op: "trust", keys: foreign.map(({ key }) => key) }))) return;
    closeDialog("trust");
    await ask({ op: "play", speed: useRun.getState().speed });
  };
  return (
    <Modal label="Code of the diagram" wide>
      <p>
        {offered
          ? "It can do whatever you can do on this machine. Let it run only if you trust who wrote it."
          : "It was written in this page or dropped on it, and does not run. To let it run, start with: motorgrad lab FILE --trust. " +
            "A file that was dropped you can also put into the editor's folder, and open it there."}
      </p>
      {foreign.map(({ path, type, code }) => (
        <section key={path} aria-label={`code of ${path}`}>
          <h3>
            {path} <span className="quiet">{type}</span>
          </h3>
          <pre tabIndex={0}>{code}</pre>
        </section>
      ))}
      {offered && (
        <div className="row">
          <button type="button" className="primary" onClick={() => void trust()}>
            Trust and run
          </button>
          <button type="button" className="plain" data-first onClick={() => closeDialog("trust")}>
            Not now
          </button>
        </div>
      )}
    </Modal>
  );
}
