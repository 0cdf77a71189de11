import { useRef } from "react";
import { isBusy, SPEEDS, togglePlay } from "../commands/run";
import { useContextOfCommands } from "../commands/useKeys";
import { useDocument, useRun } from "../session/store";
import { IconButton } from "../ui/IconButton";
import { Seeds } from "./Seeds";

const LONG = 10; // seconds

/** Play, pause, one tick, reset, speed and seeds. */
export function RunControls() {
  const context = useContextOfCommands();
  const { ask } = context;
  const state = useRun((run) => run.state);
  const speed = useRun((run) => run.speed);
  const achieved = useRun((run) => run.achieved);
  const waited = useRun((run) => run.waited) ?? 0;
  const stale = useRun((run) => run.stale);
  const pressed = useRef(false);
  const problems = useDocument((document) => document.problems.length);
  const busy = state === "playing" || state === "compiling";
  const known = SPEEDS.some(([, each]) => each === speed);
  const words =
    state === "compiling"
      ? waited < LONG
        ? "compiling…"
        : `compiling for ${waited.toFixed(0)} s: pause stops it`
      : achieved !== null && busy
        ? `${Number(achieved.toPrecision(2)).toLocaleString("en")} ×`
        : stale
          ? "changed"
          : "";
  return (
    <div className="run-controls" role="group" aria-label="run">
      <button
        type="button"
        className={`play ${busy ? "busy" : ""}`}
        aria-label={busy ? "Pause" : "Play"}
        title={`${busy ? "Pause" : "Play"} (Space)${problems ? `\n${problems} problems: see the list` : ""}`}
        // Leaving a field of seeds compiles anew, and the button says “Pause” before it is let go.
        onPointerDown={() => (pressed.current = isBusy())}
        onClick={(event) => void togglePlay(context, event.detail ? pressed.current : isBusy())}
      >
        <svg className="icon" viewBox="0 0 16 16" aria-hidden="true">
          <path d={busy ? "M5 3.5h2v9H5zM9 3.5h2v9H9z" : "M5 3l8 5-8 5z"} className="filled" />
        </svg>
      </button>
      <IconButton icon="tick" label="One tick" keys="." onClick={() => ask({ op: "tick", n: 1 })} />
      <IconButton icon="reset" label="Reset" keys="0" onClick={() => ask({ op: "reset" })} />
      <select
        aria-label="speed"
        value={String(speed)}
        onChange={(event) =>
          void ask({ op: "speed", speed: event.target.value === "null" ? null : Number(event.target.value) })
        }
      >
        {!known && <option value={String(speed)}>{speed} ×</option>}
        {SPEEDS.map(([label, each]) => (
          <option key={label} value={String(each)}>
            {label}
          </option>
        ))}
      </select>
      <Seeds />
      <span className="quiet status" role="status">
        {words}
      </span>
    </div>
  );
}
