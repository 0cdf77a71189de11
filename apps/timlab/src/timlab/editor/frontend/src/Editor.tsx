import { ReactFlowProvider } from "@xyflow/react";
import { useEffect, useMemo, useRef } from "react";
import { Breadcrumbs } from "./canvas/Breadcrumbs";
import { Brought } from "./canvas/Brought";
import { Canvas } from "./canvas/Canvas";
import { Empty } from "./canvas/Empty";
import { useKeys } from "./commands/useKeys";
import { Dialogs } from "./dialogs/Dialogs";
import { Inspector } from "./inspector/Inspector";
import { Palette } from "./palette/Palette";
import { Dock } from "./run/Dock";
import { AskContext, asking } from "./session/context";
import { receive } from "./session/receive";
import { Session } from "./session/session";
import { useDocument } from "./session/store";
import type { Transport } from "./session/transport";
import { Toasts } from "./ui/Toasts";
import { Toolbar } from "./ui/Toolbar";
import { setRoot } from "./ui/root";
import { useUi } from "./ui/ui";
import { useDark } from "./ui/useDark";
import { useNarrow } from "./ui/useNarrow";
import "@xyflow/react/dist/style.css";
import "uplot/dist/uPlot.min.css";
import "./style/index.css";

interface Props {
  transport: Transport;
  /** Whether the page is the editor's own; otherwise it is a cell of a notebook. */
  whole: boolean;
}

/** TimLab's editor, over whatever carries its messages. */
export function Editor({ transport, whole }: Props) {
  const ask = useMemo(() => {
    const session = new Session(
      transport,
      receive,
      () => useDocument.getState().revision,
      (linked) => useDocument.setState({ linked }),
    );
    return asking(session);
  }, [transport]);
  useEffect(() => () => transport.close(), [transport]);
  return (
    <AskContext value={ask}>
      <ReactFlowProvider>
        <Frame whole={whole} />
      </ReactFlowProvider>
    </AskContext>
  );
}

function Frame({ whole }: { whole: boolean }) {
  const root = useRef<HTMLDivElement>(null);
  const dark = useDark();
  const { palette, inspector, dock, dialog, adding } = useUi();
  useKeys(root, whole);
  useNarrow(root);
  return (
    <div
      ref={(element) => {
        root.current = element;
        setRoot(element);
      }}
      className={`timlab ${dark ? "dark" : "light"} ${whole ? "whole" : "cell"}`}
      tabIndex={-1}
      // In JupyterLab keys would act on cells as well.
      data-lm-suppress-shortcuts={whole ? undefined : true}
    >
      <Toolbar />
      <div className="middle">
        {palette && <Palette />}
        <main>
          <div className="stage">
            <Canvas />
            <Breadcrumbs />
            <Empty />
            <Brought />
          </div>
          {dock && <Dock />}
        </main>
        {inspector && <Inspector />}
      </div>
      {dialog === null && adding === null && <Toasts />}
      <Dialogs />
    </div>
  );
}
