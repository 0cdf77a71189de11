import { createRoot } from "react-dom/client";
import { Editor } from "./Editor";
import { modelTransport, type WidgetModel } from "./session/model";

/** What anywidget calls: the editor in a cell of a notebook. */
function render({ model, el }: { model: WidgetModel; el: HTMLElement }): () => void {
  const root = createRoot(el);
  root.render(<Editor transport={modelTransport(model)} whole={false} />);
  return () => root.unmount();
}

export default { render };
