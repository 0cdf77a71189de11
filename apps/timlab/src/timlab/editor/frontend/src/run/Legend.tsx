import { useEffect, useState } from "react";
import { useDark } from "../ui/useDark";
import { useRun } from "../session/store";
import { lineColour } from "./colours";
import { lineage } from "./lineage";
import type { Source } from "./sources";
import { onTraces } from "./traces";

const MOST = 8;

function columnsOf(source: Source): string {
  const { branch } = useRun.getState();
  const traces = source.signals.map(({ address }) => (branch === null ? undefined : lineage(branch, address)));
  const counts = traces.map((trace) => (trace?.columns.rows ?? trace?.columns.median ?? [0]).length);
  return `${counts.join()};${traces.some((trace) => trace?.columns.median?.length)}`;
}

/** Which line is which, and what bands and broken lines mean. */
export function Legend({ source, branches }: { source: Source; branches: string[] }) {
  const dark = useDark();
  const present = useRun(({ branch }) => branch);
  const [columns, setColumns] = useState(() => columnsOf(source));
  useEffect(() => onTraces(() => setColumns(columnsOf(source))), [source]);
  const [numbers = "", banded] = columns.split(";");
  const counts = numbers.split(",").map(Number);
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
      {banded === "true" && <i>median and quartiles of the seeds</i>}
      {branches.some((branch) => branch !== present) && (
        <i className="others">{branches.filter((branch) => branch !== present).join(", ")}</i>
      )}
    </span>
  );
}
