import { useRun } from "../session/store";
import { onTraces } from "./traces";

/** The first and the last tick that are shown: so many seconds up to now, and what follows where it went back. */
export function spanOf(seconds: number | null, tick: number): [number, number] {
  const { tick: now, head } = useRun.getState();
  if (seconds === null) return [0, Number.POSITIVE_INFINITY];
  const ticks = Math.max(1, Math.round(seconds / tick));
  const last = Math.max(ticks, now, Math.min(head, now + Math.round(ticks / 2)));
  return [last - ticks, last];
}

/** Be called when what is shown may have moved. Answers what ends that. */
export function onMoving(listener: () => void): () => void {
  const ends = [
    onTraces(listener),
    useRun.subscribe((run, before) => {
      // While it makes new ticks samples come; where it repeats known ones none do.
      const repeats = run.state !== "playing" || run.tick < run.head;
      if (repeats && (run.tick !== before.tick || run.branch !== before.branch)) listener();
    }),
  ];
  return () => ends.forEach((end) => end());
}
