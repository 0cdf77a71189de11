import { useAsk } from "../session/context";
import type { BlockView } from "../session/types";

/** Freezes what a block has learned, all of it or unit by unit, while it runs. */
export function Freeze({ path, view }: { path: string; view: BlockView }) {
  const ask = useAsk();
  if (view.frozen === undefined) return null;
  const units = Array.isArray(view.frozen) ? view.frozen : [view.frozen];
  const freeze = (on: boolean, unit?: number) =>
    ask({ op: "freeze", address: path, on, ...(unit !== undefined && { unit }) });
  return (
    <fieldset>
      <legend>Freeze</legend>
      <label className="check">
        <input
          type="checkbox"
          checked={units.every(Boolean)}
          aria-label="freeze all"
          onChange={(event) => void freeze(event.target.checked)}
        />
        all that it has learned
      </label>
      {units.length > 1 && (
        <div className="chips">
          {units.map((still, unit) => (
            <button
              key={unit}
              type="button"
              aria-pressed={still}
              aria-label={`freeze unit ${unit}`}
              onClick={() => void freeze(!still, unit)}
            >
              {unit}
            </button>
          ))}
        </div>
      )}
    </fieldset>
  );
}
