/** How texts reach the session: a WebSocket, or a notebook's messages. */
export type Link = "open" | "lost";

export interface Transport {
  send(text: string): void;
  onMessage(callback: (text: string) => void): void;
  /** Told at once how the link stands, and at every change. */
  onState(callback: (state: Link) => void): void;
  close(): void;
}
