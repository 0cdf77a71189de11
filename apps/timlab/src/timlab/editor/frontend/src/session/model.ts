import type { Transport } from "./transport";

/** What anywidget hands to a widget, as far as it is used here. */
export interface WidgetModel {
  send(content: unknown): void;
  on(event: "msg:custom", callback: (content: unknown) => void): void;
  off(event: "msg:custom", callback: (content: unknown) => void): void;
}

/** A notebook's custom messages. The kernel keeps the link. */
export function modelTransport(model: WidgetModel): Transport {
  const taken: ((content: unknown) => void)[] = [];
  return {
    send: (text) => model.send(text),
    onMessage: (callback) => {
      const take = (content: unknown) => {
        if (typeof content === "string") callback(content);
      };
      taken.push(take);
      model.on("msg:custom", take);
    },
    onState: (callback) => callback("open"),
    close: () => taken.forEach((take) => model.off("msg:custom", take)),
  };
}
