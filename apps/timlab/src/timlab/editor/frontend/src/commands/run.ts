import { useRun } from "../session/store";
import type { Command, Context } from "./command";

export const SPEEDS: [label: string, speed: number | null][] = [
  ["as fast as possible", null],
  ["10 ×", 10],
  ["2 ×", 2],
  ["real time", 1],
  ["½ ×", 0.5],
  ["⅒ ×", 0.1],
];

/** Whether the run plays, or will as soon as it is compiled. */
export const isBusy = (): boolean => ["playing", "compiling"].includes(useRun.getState().state);

/** Run, or pause: whatever the button said, which may change while it is pressed. */
export function togglePlay({ ask }: Context, busy = isBusy()): unknown {
  return busy ? ask({ op: "pause" }) : ask({ op: "play", speed: useRun.getState().speed });
}

const faster =
  (by: 1 | -1) =>
  ({ ask }: Context): unknown => {
    const order = [null, 10, 2, 1, 0.5, 0.1];
    const now = order.indexOf(useRun.getState().speed);
    const next = Math.max(0, Math.min(order.length - 1, (now < 0 ? 3 : now) - by));
    return ask({ op: "speed", speed: order[next] });
  };

export const fork = ({ ask }: Context): unknown => {
  const { branch, tick } = useRun.getState();
  return ask({ op: "fork", branch, tick });
};

export const runCommands: Command[] = [
  { label: "Play or pause", group: "Run", keys: ["Space"], run: (context) => togglePlay(context) },
  { label: "One tick", group: "Run", keys: ["."], run: ({ ask }) => ask({ op: "tick", n: 1 }) },
  { label: "Reset", group: "Run", keys: ["0"], run: ({ ask }) => ask({ op: "reset" }) },
  { label: "Faster", group: "Run", keys: ["+"], run: faster(1) },
  { label: "Slower", group: "Run", keys: ["-"], run: faster(-1) },
  { label: "Fork here", group: "Run", keys: ["B"], run: fork },
];
