import type { Message } from "./session";
import type { Transport } from "./transport";
import type { RunState } from "./types";

/** What a page without a server holds: the events that a client of the session would have received. */
export interface Recording {
  events: Message[];
}

const FRAME = 33; // milliseconds
const WHOLE = 10; // seconds that a recording lasts where it is played as fast as possible
const REFUSED = "This page is a recording. Its diagram can be downloaded, and changed in TimLab";

/** A session that has ended: it can be looked at and played again, and nothing in it changes. */
export function recordingTransport({ events }: Recording): Transport {
  const run = { ...(events.find(({ event }) => event === "run") as Partial<RunState> | undefined) };
  const period = Number(
    (events.find(({ event }) => event === "document") as { view?: { head: { tick: number } } } | undefined)?.view?.head
      .tick ?? 1,
  );
  const text = events.find(({ event }) => event === "text");
  let take: (text: string) => void = () => undefined;
  let timer = 0;
  let place = run.tick ?? 0;

  const tell = (message: object) => take(JSON.stringify(message));
  const show = (more: Partial<RunState>) => {
    Object.assign(run, more);
    tell({
      event: "run",
      state: run.state,
      branch: run.branch,
      tick: run.tick,
      head: run.head,
      speed: run.speed,
      ...more,
    });
  };
  const go = (tick: number) => {
    place = tick;
    show({ tick: Math.round(tick), time: Math.round(tick) * period });
  };
  const pause = () => {
    window.clearInterval(timer);
    timer = 0;
    show({ state: "paused" });
  };
  const play = (speed: number | null) => {
    const head = run.head ?? 0;
    if ((run.tick ?? 0) >= head) go(0);
    show({ state: "playing", speed });
    window.clearInterval(timer);
    timer = window.setInterval(() => {
      const ticks = run.speed == null ? (head / WHOLE) * (FRAME / 1000) : (run.speed / period) * (FRAME / 1000);
      go(Math.min(head, place + ticks));
      if (place >= head) pause();
    }, FRAME);
  };
  const perform = (operation: { op: string; [field: string]: unknown }): boolean => {
    switch (operation.op) {
      case "hello":
        events.filter(({ event }) => event !== "text").forEach(tell);
        return true;
      case "play":
        play(operation.speed as number | null);
        return true;
      case "pause":
        pause();
        return true;
      case "speed":
        show({ speed: operation.speed as number | null });
        return true;
      case "tick":
        go(Math.min(run.head ?? 0, (run.tick ?? 0) + Number(operation.n)));
        return true;
      case "reset":
        pause();
        go(0);
        return true;
      case "scrub": {
        pause();
        const branch = run.branches?.find(({ name }) => name === operation.branch);
        show({ branch: String(operation.branch), head: branch?.head ?? run.head });
        go(Number(operation.tick));
        return true;
      }
      case "text":
        if (text && !operation.python) tell(text);
        return !!text && !operation.python;
      default:
        return false;
    }
  };
  return {
    send: (message) => {
      const { client, sequence, ...operation } = JSON.parse(message) as {
        client: string;
        sequence: number;
        op: string;
      };
      // As a server would, after the call: who asks is not ready for an answer yet.
      window.setTimeout(() => {
        const done = perform(operation);
        tell(done ? { event: "done", client, sequence } : { event: "refused", client, sequence, message: REFUSED });
      }, 0);
    },
    onMessage: (callback) => {
      take = callback;
    },
    onState: (callback) => callback("open"),
    close: () => window.clearInterval(timer),
  };
}
