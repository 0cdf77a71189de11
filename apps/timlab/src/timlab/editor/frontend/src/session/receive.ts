import { keepBranches, takeSamples } from "../run/traces";
import { forgetPlaces } from "../canvas/layout";
import { toast, useUi } from "../ui/ui";
import type { Message } from "./session";
import { type Document, useDocument, useRun } from "./store";
import type { RunState } from "./types";
import { type Change, changed, flat, shaped, type View } from "./views";

function flags(message: Message): Partial<Document> {
  return {
    revision: message.revision as number,
    file: message.file as string | null,
    saved: message.saved as boolean,
    canUndo: message.can_undo as boolean,
    canRedo: message.can_redo as boolean,
  };
}

/** Stay in the subsystem that is open, or go out to where it was. */
function stay(): void {
  const { scopes } = useDocument.getState();
  const { at } = useUi.getState();
  let depth = at.length;
  while (depth > 0 && !(at.slice(0, depth).join("/") in scopes)) depth -= 1;
  if (depth < at.length) useUi.setState({ at: at.slice(0, depth), selected: [] });
}

/** Put what the session tells where it is looked at. */
export function receive(message: Message): void {
  switch (message.event) {
    case "declarations":
      useDocument.setState({
        categories: message.categories as Document["categories"],
        declarations: message.blocks as Document["declarations"],
        gallery: message.gallery as Document["gallery"],
        words: new Set(message.words as string[]),
      });
      break;
    case "document":
      forgetPlaces();
      useDocument.setState((old) => ({
        ...flags(message),
        opened: old.opened + 1,
        shapes: {},
        foreign: [],
        scopes: flat(message.view as View),
      }));
      stay();
      break;
    case "changed":
      useDocument.setState((old) => ({
        ...flags(message),
        scopes: shaped(changed(old.scopes, message.scopes as Change[]), old.shapes),
      }));
      stay();
      break;
    case "problems":
      useDocument.setState((old) => ({
        problems: message.list as Document["problems"],
        warnings: message.warnings as Document["warnings"],
        foreign: message.foreign as Document["foreign"],
        shapes: message.shapes as Document["shapes"],
        scopes: shaped(old.scopes, message.shapes as Document["shapes"]),
      }));
      break;
    case "recoverable":
      useDocument.setState({ recoverable: message.list as Document["recoverable"] });
      break;
    case "run":
      useRun.setState((old) => {
        const run = message as unknown as Partial<RunState>;
        // the same list is kept if it says the same, so that the canvas is not made anew
        const same = run.faults === undefined || JSON.stringify(run.faults) === JSON.stringify(old.faults);
        return same ? { ...run, faults: old.faults } : run;
      });
      if (message.branches) keepBranches((message.branches as RunState["branches"]).map(({ name }) => name));
      break;
    case "samples":
      takeSamples(message);
      break;
    case "saved":
      useDocument.setState(flags(message));
      toast(`Saved as ${String(message.file)}`);
      break;
    case "replayed":
      toast(
        message.matches ? "Replayed: identical bit for bit" : "Replayed: the final state differs",
        !message.matches,
      );
      break;
    case "refused":
    case "error":
      toast(String(message.message), true);
      break;
  }
}
