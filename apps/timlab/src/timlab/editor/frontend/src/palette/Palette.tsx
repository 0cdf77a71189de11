import { type KeyboardEvent, useState } from "react";
import { add } from "../canvas/useDropped";
import { freePlace } from "../commands/selection";
import { useContextOfCommands } from "../commands/useKeys";
import { useDocument } from "../session/store";
import { find } from "../ui/root";
import { setPanel, useUi } from "../ui/ui";
import { PaletteItem } from "./PaletteItem";
import { found } from "./search";

const ORDER = [
  "sources",
  "mathematics",
  "dynamics",
  "sinks",
  "learning",
  "bodies and worlds",
  "vectors",
  "nonlinear",
  "logic",
  "subsystems",
];
const placeOf = (category: string) => (ORDER.includes(category) ? ORDER.indexOf(category) : ORDER.length);
const inOrder = ([a]: [string, unknown], [b]: [string, unknown]) => placeOf(a) - placeOf(b);

/** All types of blocks, by heading or by search. Drag one to the canvas, or press Enter. */
export function Palette() {
  const context = useContextOfCommands();
  const categories = useDocument((document) => document.categories);
  const declarations = useDocument((document) => document.declarations);
  const text = useUi((ui) => ui.sought);
  const setText = (sought: string) => useUi.setState({ sought });
  const [chosen, setChosen] = useState(0);
  const hits = text.trim() ? found(Object.values(declarations), text) : null;

  const put = (type: string) => {
    const needed = declarations[type]?.fields.some((field) => field.required);
    if (needed) useUi.setState({ adding: type });
    else void add(context, type, freePlace(context));
    if (useUi.getState().narrow) setPanel("palette", false);
  };
  const press = (event: KeyboardEvent) => {
    if (event.key === "ArrowDown" || event.key === "ArrowUp") {
      event.preventDefault();
      const step = event.key === "ArrowDown" ? 1 : -1;
      setChosen((now) => Math.max(0, Math.min((hits?.length ?? 1) - 1, now + step)));
    } else if (event.key === "Enter" && hits?.[chosen]) {
      put(hits[chosen].name);
    } else if (event.key === "Escape") {
      setText("");
      find(".react-flow__pane")?.focus();
      (event.target as HTMLElement).blur();
    }
  };
  return (
    <aside className="palette side" aria-label="palette">
      <input
        type="search"
        placeholder="Search blocks"
        aria-label="Search blocks"
        value={text}
        onChange={(event) => {
          setText(event.target.value);
          setChosen(0);
        }}
        onKeyDown={press}
      />
      <div className="scroll">
        {hits?.map((declaration, place) => (
          <PaletteItem key={declaration.name} declaration={declaration} chosen={place === chosen} onAdd={put} />
        ))}
        {Object.keys(declarations).length === 0 && <p className="quiet pad">Loading…</p>}
        {hits?.length === 0 && <p className="quiet pad">Nothing answers to “{text}”.</p>}
        {!hits &&
          Object.entries(categories)
            .sort(inOrder)
            .map(([category, names]) => (
              <details key={category} open>
                <summary>{category}</summary>
                {names.map((name) => {
                  const declaration = declarations[name];
                  return declaration && <PaletteItem key={name} declaration={declaration} chosen={false} onAdd={put} />;
                })}
              </details>
            ))}
      </div>
    </aside>
  );
}
