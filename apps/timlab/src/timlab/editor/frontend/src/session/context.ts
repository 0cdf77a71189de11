import { createContext, useContext } from "react";
import { toast } from "../ui/ui";
import { type Message, type Operation, Refusal, type Session } from "./session";

/** Sends an operation; what the session refuses is told to the user, and answered by null. */
export type Ask = (operation: Operation) => Promise<Message | null>;

export const asking =
  (session: Session): Ask =>
  async (operation) => {
    try {
      return await session.ask(operation);
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      toast(error.message, true);
      return null;
    }
  };

export const AskContext = createContext<Ask>(() => Promise.resolve(null));

export const useAsk = (): Ask => useContext(AskContext);
