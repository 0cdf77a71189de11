import type { Link, Transport } from "./transport";

const LONGEST_WAIT = 5000;

/** A WebSocket that opens itself again when it is lost. */
export function socketTransport(address: string): Transport {
  const messages: ((text: string) => void)[] = [];
  const states: ((state: Link) => void)[] = [];
  let socket: WebSocket | null = null;
  let state: Link = "lost";
  let wait = 250;
  let timer = 0;
  let closed = false;

  const tell = (next: Link) => {
    state = next;
    states.forEach((callback) => callback(next));
  };
  const open = () => {
    socket = new WebSocket(address);
    socket.onopen = () => {
      wait = 250;
      tell("open");
    };
    socket.onmessage = (event) => messages.forEach((callback) => callback(String(event.data)));
    socket.onclose = () => {
      tell("lost");
      if (closed) return;
      timer = window.setTimeout(open, wait);
      wait = Math.min(LONGEST_WAIT, 2 * wait);
    };
  };
  open();
  return {
    send: (text) => {
      if (socket?.readyState === WebSocket.OPEN) socket.send(text);
    },
    onMessage: (callback) => void messages.push(callback),
    onState: (callback) => {
      states.push(callback);
      callback(state);
    },
    close: () => {
      closed = true;
      window.clearTimeout(timer);
      socket?.close();
    },
  };
}
