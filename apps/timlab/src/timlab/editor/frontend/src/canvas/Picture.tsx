import { memo, useMemo } from "react";
import { Drawing } from "../run/Drawing";
import { Lines } from "../run/Lines";
import { sourceOf } from "../run/sources";
import { useShown } from "../run/useShown";
import { emptyScope, useDocument } from "../session/store";
import type { BlockView } from "../session/types";
import { HEADER, ROW, rowsOf } from "./geometry";

const WINDOW = 10; // seconds

/** What a sink sees, on the canvas, while it runs. */
export const Picture = memo(function Picture({ path, view }: { path: string; view: BlockView }) {
  const at = path.split("/").slice(0, -1).join("/");
  const scope = useDocument((document) => document.scopes[at] ?? emptyScope);
  const tick = useDocument((document) => document.scopes[""]?.tick ?? 0.01);
  const branches = useShown(false);
  const source = useMemo(() => sourceOf(at, view, scope), [at, view, scope]);
  const Shown = source.drawing === "lines" ? Lines : Drawing;
  return (
    <div className="picture" style={{ top: HEADER + rowsOf(view) * ROW }}>
      <Shown source={source} branches={branches} window={Number(view.fields.window) || WINDOW} tick={tick} small />
    </div>
  );
});
