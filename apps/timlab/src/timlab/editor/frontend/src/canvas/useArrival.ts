import { useEffect } from "react";
import { select } from "../commands/selection";
import { LEAST_ZOOM } from "../commands/view";
import type { Context } from "../commands/command";
import { useDocument } from "../session/store";
import { find } from "../ui/root";
import { useUi } from "../ui/ui";

/** Show a whole diagram when it is opened, and a block when it is asked for. */
export function useArrival(context: Context, there: boolean): void {
  const path = useUi((ui) => ui.at.join("/"));
  const id = useDocument((document) => document.opened);
  const show = useUi((ui) => ui.show);
  useEffect(() => {
    if (!there) return;
    const timer = window.setTimeout(
      () => void context.flow.fitView({ minZoom: LEAST_ZOOM, maxZoom: 1, padding: 0.12 }),
      30,
    );
    return () => window.clearTimeout(timer);
    // Once for each diagram, not for each change of it.
  }, [path, id, there]); // eslint-disable-line
  useEffect(() => {
    if (show === null || !there) return;
    const timer = window.setTimeout(() => {
      useUi.setState({ show: null });
      select([show]);
      void context.flow.fitView({ nodes: [{ id: show }], maxZoom: 1, minZoom: 0.6, duration: 200 });
      find(`.react-flow__node[data-id="${CSS.escape(show)}"]`)?.focus();
    }, 60);
    return () => window.clearTimeout(timer);
  }, [show, there]); // eslint-disable-line
}
