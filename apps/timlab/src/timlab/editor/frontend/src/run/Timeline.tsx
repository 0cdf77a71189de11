import { useRef, useState } from "react";
import { useAsk } from "../session/context";
import { useRun } from "../session/store";
import { IconButton } from "../ui/IconButton";

interface Props {
  compare: boolean;
  onCompare: (on: boolean) => void;
  all: boolean;
  onAll: (on: boolean) => void;
}

/** Goes back in time, forks, and changes from one branch to another. */
export function Timeline({ compare, onCompare, all, onAll }: Props) {
  const ask = useAsk();
  const { branch, branches, tick, head, time, fixed, state } = useRun();
  const [held, setHeld] = useState<number | null>(null);
  const busy = useRef(false);
  const wanted = useRef<number | null>(null);

  // One question at a time: of what is wanted meanwhile only the last counts.
  const scrub = async (to: number) => {
    wanted.current = to;
    if (busy.current) return;
    busy.current = true;
    while (wanted.current !== null) {
      const next = wanted.current;
      wanted.current = null;
      await ask({ op: "scrub", branch, tick: next });
    }
    busy.current = false;
    setHeld(null);
  };
  const there = branch !== null;
  const go = (name: string) => {
    const other = branches.find((each) => each.name === name);
    if (other) void ask({ op: "scrub", branch: name, tick: other.head });
  };
  return (
    <div className="timeline">
      <output className="clock" aria-label="time">
        {time.toFixed(2)} s<small>tick {tick}</small>
      </output>
      <input
        type="range"
        aria-label="time travel"
        min={0}
        max={Math.max(1, head)}
        step={1}
        value={held ?? tick}
        disabled={!there || fixed !== null}
        title={fixed ?? "Go back in time"}
        onChange={(event) => {
          setHeld(Number(event.target.value));
          void scrub(Number(event.target.value));
        }}
      />
      {there && branches.length > 1 && (
        <select aria-label="branch" value={branch} onChange={(event) => go(event.target.value)}>
          {branches.map(({ name, start, edited }) => (
            <option key={name} value={name}>
              {name}
              {start > 0 ? ` (${edited ? "edited" : "forked"} at ${start})` : ""}
            </option>
          ))}
        </select>
      )}
      <IconButton
        icon="fork"
        label="Fork here"
        keys="B"
        disabled={!there || fixed !== null || state === "compiling"}
        onClick={() => ask({ op: "fork", branch, tick })}
      />
      {branches.length > 1 && (
        <>
          <IconButton icon="close" label="Delete this branch" onClick={() => ask({ op: "prune", branch })} />
          <label className="check">
            <input type="checkbox" checked={compare} onChange={(event) => onCompare(event.target.checked)} />
            compare
          </label>
        </>
      )}
      <label className="check">
        <input type="checkbox" checked={all} onChange={(event) => onAll(event.target.checked)} />
        all time
      </label>
    </div>
  );
}
