import { useEffect, useRef, useState } from "react";
import type { Field } from "../session/types";
import { sliderRange, stepOf } from "./values";

interface Props {
  field: Field;
  value: number;
  onSet: (value: number) => void;
}

const APART = 40; // milliseconds between two values that are sent

/** Changes a number while it runs. Its range stays while it is moved. */
export function Slider({ field, value, onSet }: Props) {
  const [range, setRange] = useState(() => sliderRange(field, value));
  const [held, setHeld] = useState<number | null>(null);
  const next = useRef<number | null>(null);
  const timer = useRef(0);
  useEffect(() => {
    if (held === null && (value < range[0] || value > range[1])) setRange(sliderRange(field, value));
  }, [value, held, field, range]);
  const flush = () => {
    timer.current = 0;
    if (next.current !== null) onSet(next.current);
    next.current = null;
  };
  const move = (to: number) => {
    setHeld(to);
    next.current = to;
    if (!timer.current) timer.current = window.setTimeout(flush, APART);
  };
  const release = () => {
    setHeld(null);
    setRange(sliderRange(field, next.current ?? held ?? value));
  };
  const [low, high] = range;
  return (
    <input
      type="range"
      aria-label={`${field.name} slider`}
      min={low}
      max={high}
      step={stepOf(field, low, high)}
      value={held ?? value}
      onChange={(event) => move(Number(event.target.value))}
      onPointerUp={release}
      onKeyUp={release}
      onBlur={() => setHeld(null)}
    />
  );
}
