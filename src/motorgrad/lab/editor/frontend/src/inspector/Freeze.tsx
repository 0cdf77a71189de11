import { useAsk } from "../session/context";
import type { BlockView } from "../session/types";

/** Freezes what a block has learnt, all of it or unit by unit, while it runs. */
export function Freeze({ path, view }: { path: string; view: BlockView }) {
  const ask = useAsk();
  const frozen = view.fields.frozen;
  if (frozen === undefined) return null;
  const groups = Array.isArray(view.fields.groups) ? view.fields.groups.length : 0;
  const units = Array.isArray(frozen) ? Math.max(groups, frozen.length) : groups;
  const isFrozen = (unit: number) => (Array.isArray(frozen) ? frozen[unit] === true : frozen === true);
  const all = Array.isArray(frozen) ? frozen.every((each) => each === true) : frozen === true;
  const freeze = (on: boolean, unit?: number) =>
    ask({ op: "freeze", address: path, on, ...(unit !== undefined && { unit }) });
  return (
    <fieldset>
      <legend>Freeze</legend>
      <label className="check">
        <input
          type="checkbox"
          checked={all}
          aria-label="freeze all"
          onChange={(event) => void freeze(event.target.checked)}
        />
        all that it has learnt
      </label>
      {units > 1 && (
        <div className="chips">
          {Array.from({ length: units }, (_, unit) => (
            <button
              key={unit}
              type="button"
              aria-pressed={isFrozen(unit)}
              aria-label={`freeze unit ${unit}`}
              onClick={() => void freeze(!isFrozen(unit), unit)}
            >
              {unit}
            </button>
          ))}
        </div>
      )}
    </fieldset>
  );
}
