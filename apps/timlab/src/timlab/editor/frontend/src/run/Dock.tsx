import { useMemo, useState } from "react";
import { useDocument, useRun } from "../session/store";
import { Drawing } from "./Drawing";
import { Keep } from "./Keep";
import { Legend } from "./Legend";
import { Lines } from "./Lines";
import { type Source, sourcesOf } from "./sources";
import { Timeline } from "./Timeline";
import { goTo } from "../inspector/Problems";
import { useHeight } from "./useHeight";
import { useShown } from "./useShown";

const WINDOW = 10;
const SHOWN = new Set(["lines", "portrait", "raster", "histogram", "map"]);

/** Below the canvas: time, and all that shows something. */
export function Dock() {
  const scopes = useDocument((document) => document.scopes);
  const watch = useRun((run) => run.watch);
  const [compare, setCompare] = useState(true);
  const [all, setAll] = useState(false);
  const { height, grip } = useHeight();
  const tick = scopes[""]?.tick ?? 0.01;
  const sources = useMemo(() => sourcesOf(scopes, watch).filter(({ drawing }) => SHOWN.has(drawing)), [scopes, watch]);
  const shown = useShown(compare);
  const picture = (source: Source) => {
    const own = Number(source.fields.window) || WINDOW;
    const Shown = source.drawing === "lines" ? Lines : Drawing;
    return (
      <figure key={source.path} className={`scope ${source.drawing}`} aria-label={`scope ${source.path}`}>
        <figcaption>
          <button type="button" onClick={() => goTo(source.path.replace(/\.[^./]*$/, ""))}>
            {source.path}
          </button>
          {source.drawing === "lines" && <Legend source={source} branches={shown} />}
          <Keep wanted={{ source, branches: shown, window: all ? null : own, tick }} />
        </figcaption>
        <Shown source={source} branches={shown} window={all ? null : own} tick={tick} />
      </figure>
    );
  };
  return (
    <section className="dock" aria-label="scopes" style={{ height }}>
      {grip}
      <Timeline compare={compare} onCompare={setCompare} all={all} onAll={setAll} />
      <div className="scopes">
        {sources.map(picture)}
        {sources.length === 0 && (
          <p className="quiet pad">Nothing is recorded yet. Add a scope, or tick “Watch” in a block's form.</p>
        )}
      </div>
    </section>
  );
}
