import { type KeyboardEvent, type PointerEvent, useState } from "react";

const LEAST = 90;
const STEP = 20;

/** A height that is drawn at an edge, or changed by arrows there. */
export function useHeight() {
  const [height, setHeight] = useState(260);
  const put = (wanted: number) => setHeight(Math.max(LEAST, Math.min(window.innerHeight * 0.7, wanted)));
  const drag = (event: PointerEvent<HTMLDivElement>) => {
    const [start, from] = [event.clientY, height];
    const own = event.currentTarget;
    own.setPointerCapture(event.pointerId);
    own.onpointermove = (move) => put(from + start - move.clientY);
    own.onpointerup = () => (own.onpointermove = null);
  };
  const press = (event: KeyboardEvent) => {
    if (event.key === "ArrowUp") put(height + STEP);
    if (event.key === "ArrowDown") put(height - STEP);
  };
  const grip = (
    <div
      className="grip"
      role="separator"
      aria-orientation="horizontal"
      aria-label="height of the scopes"
      aria-valuenow={Math.round(height)}
      tabIndex={0}
      onPointerDown={drag}
      onKeyDown={press}
    />
  );
  return { height, grip };
}
