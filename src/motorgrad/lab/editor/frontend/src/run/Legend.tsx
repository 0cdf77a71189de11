import { useEffect, useState } from "react";
import { useDark } from "../ui/useDark";
import { useRun } from "../session/store";
import { lineColour } from "./colours";
import { lineage } from "./lineage";
import type { Source } from "./sources";
import { onTraces } from "./traces";

const MOST = 8;

function columnsOf(source: Source): number[] {
  const { branch } = useRun.getState();
  return source.signals.map(({ address }) => {
    const trace = branch === null ? undefined : lineage(branch, address);
    return (trace?.columns.rows ?? trace?.columns.median ?? [0]).length;
  });
}

/** Which line is which. */
export function Legend({ source }: { source: Source }) {
  const dark = useDark();
  const [columns, setColumns] = useState(() => columnsOf(source).join());
  useEffect(() => onTraces(() => setColumns(columnsOf(source).join())), [source]);
  const counts = columns.split(",").map(Number);
  const names = source.signals.flatMap(({ label }, i) =>
    counts[i] === 1 ? [label] : Array.from({ length: counts[i] ?? 1 }, (_, column) => `${label}[${column}]`),
  );
  return (
    <span className="legend">
      {names.slice(0, MOST).map((name, place) => (
        <span key={name} style={{ "--hue": lineColour(place, dark) } as React.CSSProperties}>
          {name}
        </span>
      ))}
      {names.length > MOST && <i>and {names.length - MOST} more</i>}
    </span>
  );
}
