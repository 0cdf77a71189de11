/** Small drawings for types of blocks, in a square of 16: what each does to a signal. */
const PATHS: Record<string, string> = {
  sine: "M2 8c2-7 4-7 6 0s4 7 6 0",
  chirp: "M1 8c2-7 3.5-7 5 0s2.5 7 4 0 1.5-6 2.4 0 1.2 5 2 0",
  constant: "M2 8h12M3 13h10",
  step: "M2 12h5V4h7",
  ramp: "M2 13h3L14 4",
  pulse: "M2 12h2V4h3v8h3V4h3v8h1",
  "normal noise": "M2 13c4 0 3.5-10 6-10s2 10 6 10",
  "uniform noise": "M2 13h2V5h8v8h2",
  "data file": "M4 2h6l3 3v9H4zM6 8h5M6 11h5",
  sum: "M12 4V3H4l4 5-4 5h8v-1",
  product: "M4 4l8 8M12 4l-8 8",
  gain: "M3 2.5v11L14 8z",
  "matrix gain": "M5 2H3v12h2M11 2h2v12h-2M6.5 5h0M9.5 5h0M6.5 8h0M9.5 8h0M6.5 11h0M9.5 11h0",
  expression: "M10.5 3c-2-1-3 0-3.3 2L6 12c-.3 2-1.3 2.5-3 2M5 7.5h5M10 10l3.5 3.5M13.5 10l-3.5 3.5",
  function: "M10.5 3c-2-1-3 0-3.3 2L6 12c-.3 2-1.3 2.5-3 2M5 7.5h5",
  integrator: "M11 3c-2-1.5-3 0-3 2v6c0 2-1 3.5-3 2",
  "discrete integrator": "M2 13V9h3V6.5h3V4h3V2.5h3",
  lag: "M2 13h2c1.5-8 4-9 10-9",
  "discrete lag": "M2 13h3V8h3V5.5h3V4h3",
  "unit delay": "M3 3h5l-5 6h5M11 3v3M11 13V9l-1 1",
  delay: "M8 2.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11zM8 5v3l2 2",
  "transfer function": "M2 8h12M8 4.5h0M5 4h6M5 12h2M9 12h2",
  "discrete transfer function": "M2 8h12M5 4h6M4 12h1M7.5 12h1M11 12h1",
  "state space": "M3 3l2.5 6L8 3M9 6h5M9 9h5M3 13h10",
  "discrete state space": "M3 3l2.5 6L8 3M9 6h5M9 9h5M3 13h2M7 13h2M11 13h2",
  "PID controller": "M2 12h3V3M5 12l5-6h4",
  "discrete PID controller": "M2 12h3V4M5 12h3V8h3V5h3",
  saturation: "M2 12h4l4-8h4",
  "dead zone": "M2 13l4-5h4l4-5",
  relay: "M2 12h7V4M7 12V4h7",
  backlash: "M3 12h4l5-8H8z",
  quantiser: "M2 13h3v-3h3V7h3V4h3",
  "rate limit": "M2 12h3l5-8h4",
  "look-up table": "M2 12l4-6 3 3 5-6M6 6h0M9 9h0",
  "look-up table 2-D": "M2.5 2.5h11v11h-11zM2.5 6h11M2.5 10h11M6 2.5v11M10 2.5v11",
  compare: "M5 3.5L11 8l-6 4.5",
  logic: "M3 3h5a5 5 0 0 1 0 10H3z",
  not: "M3 3v10l8-5zM11.5 8a1.3 1.3 0 1 0 2.6 0 1.3 1.3 0 0 0-2.6 0",
  counter: "M3 13V9M6 13V7M9 13V5M12 13V3",
  switch: "M2 8h3l6-4M11 4h3M11 12h3",
  "multi-switch": "M2 8h3l6-5M11 3h3M11 8h3M11 13h3",
  "sample and hold": "M2 11h3V6h4v3h4V4h1M2 14h12",
  "state machine":
    "M4.5 6a2.5 2.5 0 1 0 0 5 2.5 2.5 0 0 0 0-5zM11.5 6a2.5 2.5 0 1 0 0 5 2.5 2.5 0 0 0 0-5zM5 5c2-3 4-3 6 0",
  scope: "M2 3h12v9H2zM4 8.5c1-4 2.5-4 4 0s3 2 4-1",
  "XY portrait": "M3 2v11h11M6 9c0-5 6-5 6-1.5S7 11 6 9",
  raster: "M3 3v3M6 3v3M11 3v3M4 7v3M9 7v3M3 11v3M7 11v3M12 11v3",
  histogram: "M2 13h12M3.5 13V9M6.5 13V5M9.5 13V3M12.5 13V8",
  recorder: "M3 3h10v10H3zM6 6h4v4H6z",
  "policy map": "M3 2v11h11M7 8a3 2 0 1 0 .1 0M11 5a2 2 0 1 0 .1 0",
  join: "M2 4h4l3 4h5M2 12h4l3-4M2 8h7",
  select: "M2 8h4l4-4h4M10 12h4M6 8l3 3",
  reduce: "M2 3h3l5 5-5 5H2M10 8h4",
  inlet: "M2 8h8M7 5l3 3-3 3M13 3v10",
  outlet: "M3 3v10M6 8h8M11 5l3 3-3 3",
  diagram: "M2 3h5v4H2zM9 9h5v4H9zM7 5h4.5v4",
  body: "M8 2a2 2 0 1 0 .1 0M8 6v4M8 10l-3 4M8 10l3 4M4 8l4-1 4 1",
  "mujoco model": "M8 2l5 3v6l-5 3-5-3V5zM8 8l5-3M8 8v6M8 8L3 5",
  "hill muscle": "M2 8h2c1-4 7-4 8 0h2M4 8c1 4 7 4 8 0",
  muscle: "M2 8h2c1-4 7-4 8 0h2M4 8c1 4 7 4 8 0",
  world: "M8 2.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11zM2.5 8h11M8 2.5c-4 3-4 8 0 11M8 2.5c4 3 4 8 0 11",
  environment: "M8 2.5a5.5 5.5 0 1 0 0 11 5.5 5.5 0 0 0 0-11zM2.5 8h11",
  network: "M3 4h0M3 12h0M8 8h0M13 8h0M3 4l5 4-5 4M8 8h5",
};
const OF_CATEGORY: Record<string, string> = {
  learning: "M2 13c3 0 4-2 5-5s2-5 7-5M11 1.5L14 3l-1.5 2.5",
  "bodies and worlds": PATHS.body!,
  dynamics: PATHS.lag!,
  logic: PATHS.logic!,
  sinks: PATHS.scope!,
  sources: PATHS.sine!,
};
const OTHER = "M3 4h10v8H3z";

/** The picture of a type of block; one of its heading where it has none of its own. */
export const iconOf = (type: string, category: string): string => PATHS[type] ?? OF_CATEGORY[category] ?? OTHER;

export function BlockIcon({ type, category }: { type: string; category: string }) {
  return (
    <svg className="block-icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={iconOf(type, category)} />
    </svg>
  );
}
