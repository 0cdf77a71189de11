import type { Transport } from "./transport";

export type Message = { event: string; [field: string]: unknown };
export type Operation = { op: string; [field: string]: unknown };

interface Pending {
  op: string;
  text: string;
  /** What was asked for, which comes before the word that it is done. */
  answer?: Message;
  resolve: (answer: Message) => void;
  reject: (error: Refusal) => void;
}

/** The session's no, with the place that it is about. */
export class Refusal extends Error {
  constructor(
    message: string,
    readonly path: string | null = null,
  ) {
    super(message);
  }
}

const ANSWERS = new Set(["fragment", "text", "files", "log", "page"]);

/** A client of the session: numbers operations, and sends those again that a lost link left without an answer. */
export class Session {
  private readonly client = crypto.randomUUID();
  private readonly pending = new Map<number, Pending>();
  private sequence = 0;
  private open = false;

  constructor(
    private readonly transport: Transport,
    private readonly take: (message: Message) => void,
    private readonly revision: () => number | null,
    onLink: (open: boolean) => void,
  ) {
    transport.onMessage((text) => this.received(JSON.parse(text) as Message));
    transport.onState((state) => {
      const opened = state === "open" && !this.open;
      this.open = state === "open";
      if (opened) this.greet();
      onLink(this.open);
    });
  }

  ask(operation: Operation): Promise<Message> {
    const sequence = ++this.sequence;
    const text = JSON.stringify({ client: this.client, sequence, ...operation });
    return new Promise((resolve, reject) => {
      this.pending.set(sequence, { op: operation.op, text, resolve, reject });
      if (this.open) this.transport.send(text);
    });
  }

  close(): void {
    this.transport.close();
  }

  private greet(): void {
    const sequence = ++this.sequence;
    this.transport.send(JSON.stringify({ client: this.client, sequence, op: "hello", revision: this.revision() }));
    for (const { text } of this.pending.values()) this.transport.send(text);
  }

  private received(message: Message): void {
    const sequence = Number(message.sequence);
    const waiting = message.client === this.client ? this.pending.get(sequence) : undefined;
    if (message.event === "done") {
      this.pending.delete(sequence);
      waiting?.resolve(waiting.answer ?? message);
    } else if (waiting && message.event === "refused") {
      this.pending.delete(sequence);
      waiting.reject(new Refusal(String(message.message), (message.path as string | undefined) ?? null));
    } else if (ANSWERS.has(message.event)) {
      const asked = [...this.pending.values()].find(({ op, answer }) => op === message.event && !answer);
      if (asked) asked.answer = message;
    } else {
      this.take(message);
    }
  }
}
