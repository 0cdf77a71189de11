import { useReactFlow } from "@xyflow/react";
import { type RefObject, useEffect } from "react";
import { LEAST_ZOOM } from "../commands/view";
import { useUi } from "./ui";

const NARROW = 900; // pixels, below which panels are folded away

/** Fold the panels away where the editor is narrow, and show the whole diagram in the room that is left. */
export function useNarrow(root: RefObject<HTMLElement | null>): void {
  const flow = useReactFlow();
  useEffect(() => {
    const element = root.current;
    if (!element) return;
    let wide = { palette: true, inspector: true };
    const observer = new ResizeObserver(() => {
      const { narrow: was, palette, inspector } = useUi.getState();
      const narrow = element.clientWidth < NARROW;
      if (narrow === was || element.clientWidth === 0) return;
      if (narrow) wide = { palette, inspector };
      useUi.setState({ narrow, ...(narrow ? { palette: false, inspector: false } : wide) });
      window.setTimeout(() => void flow.fitView({ minZoom: LEAST_ZOOM, maxZoom: 1, padding: 0.1 }), 60);
    });
    observer.observe(element);
    return () => observer.disconnect();
  }, [root, flow]);
}
