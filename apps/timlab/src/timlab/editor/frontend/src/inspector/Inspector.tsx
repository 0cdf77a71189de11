import { LogPanel } from "../run/LogPanel";
import { useProblems } from "../session/store";
import { useScope } from "../session/useScope";
import { type Tab, useUi } from "../ui/ui";
import { BlockForm } from "./BlockForm";
import { DiagramForm } from "./DiagramForm";
import { Many } from "./Many";
import { Problems } from "./Problems";

const TABS: Tab[] = ["Form", "Problems", "Log"];

/** Beside the canvas: the form of what is selected, what is wrong, and what was done. */
export function Inspector() {
  const tab = useUi((ui) => ui.tab);
  const scope = useScope();
  const selected = useUi((ui) => ui.selected).filter((name) => name in scope.nodes);
  const problems = useProblems().length;
  const [first] = selected;
  const view = first === undefined ? undefined : scope.nodes[first];
  return (
    <aside className="inspector side" aria-label="inspector">
      <div role="tablist" className="tabs">
        {TABS.map((each) => (
          <button
            key={each}
            type="button"
            role="tab"
            aria-selected={tab === each}
            onClick={() => useUi.setState({ tab: each })}
          >
            {each}
            {each === "Problems" && problems > 0 && <span className="count">{problems}</span>}
          </button>
        ))}
      </div>
      <div className="scroll" role="tabpanel" aria-label={tab}>
        {tab === "Problems" && <Problems />}
        {tab === "Log" && <LogPanel />}
        {tab === "Form" && selected.length > 1 && <Many names={selected} />}
        {tab === "Form" && selected.length === 1 && view && <BlockForm key={first} name={first!} view={view} />}
        {tab === "Form" && selected.length === 0 && <DiagramForm />}
      </div>
    </aside>
  );
}
