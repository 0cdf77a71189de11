import { useEffect, useState } from "react";
import { useAsk } from "../session/context";
import { useRun } from "../session/store";

/** How many seeds run side by side: of more than one, scopes show the median and a band between the quartiles. */
export function Seeds() {
  const ask = useAsk();
  const seeds = useRun((run) => (Array.isArray(run.seeds) ? run.seeds.length : run.seeds));
  const [text, setText] = useState(String(seeds));
  useEffect(() => setText(String(seeds)), [seeds]);
  const give = () => {
    const n = Number(text);
    if (n === seeds) return;
    if (Number.isInteger(n) && n >= 1) void ask({ op: "seeds", n });
    else setText(String(seeds));
  };
  return (
    <label className="seeds" title="Seeds that run side by side; changing them restarts the run">
      seeds
      <input
        inputMode="numeric"
        aria-label="seeds"
        value={text}
        onChange={(event) => setText(event.target.value)}
        onBlur={give}
        onKeyDown={(event) => event.key === "Enter" && give()}
      />
    </label>
  );
}
