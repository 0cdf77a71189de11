import { useProblems } from "../session/store";
import { enter, useUi } from "../ui/ui";

/** Show the block of a path, in its subsystem. */
export function goTo(path: string): void {
  const names = path.split("/");
  const at = names.slice(0, -1);
  if (at.join("/") !== useUi.getState().at.join("/")) enter(at);
  useUi.setState({ show: names[names.length - 1]! });
}

/** All that keeps the diagram from running, what is not finite in its run, and what to beware of. */
export function Problems() {
  const problems = useProblems();
  if (!problems.length) return <p className="quiet pad">No problems: the diagram can run.</p>;
  return (
    <ul className="list" aria-label="problems">
      {problems.map(({ path, port, message, grade }) => (
        <li key={`${path}.${port}:${message}`} className={grade}>
          <button type="button" onClick={() => goTo(path)}>
            <b>{port ? `${path}.${port}` : path || "diagram"}</b>
            {grade === "warning" && <em>Warning. </em>}
            {message}
          </button>
        </li>
      ))}
    </ul>
  );
}
