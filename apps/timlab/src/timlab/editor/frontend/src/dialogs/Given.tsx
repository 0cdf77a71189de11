import { useState } from "react";
import { add } from "../canvas/useDropped";
import { freePlace } from "../commands/selection";
import { useContextOfCommands } from "../commands/useKeys";
import { fromText } from "../inspector/values";
import { useDocument } from "../session/store";
import { Modal } from "../ui/Modal";
import { prose } from "../ui/prose";
import { useUi } from "../ui/ui";

/** Asks for the fields without which a type of block cannot be made. */
export function Given({ type }: { type: string }) {
  const context = useContextOfCommands();
  const fields = useDocument((document) => document.declarations[type]?.fields.filter((field) => field.required)) ?? [];
  const [texts, setTexts] = useState<Record<string, string>>({});
  const done = () => useUi.setState({ adding: null, dialog: null });
  return (
    <Modal label={`Add ${type}`}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          const given = Object.fromEntries(
            fields.map((field) => [field.name, fromText(texts[field.name] ?? "", field)]),
          );
          done();
          void add(context, type, freePlace(context), given);
        }}
      >
        {fields.map((field) => (
          <div key={field.name} className="field">
            <label htmlFor={`given-${field.name}`}>{field.name}</label>
            <input
              id={`given-${field.name}`}
              data-first
              onChange={(event) => setTexts({ ...texts, [field.name]: event.target.value })}
            />
            <p className="help">{prose(field.help ?? "")}</p>
          </div>
        ))}
        <button type="submit" className="primary">
          Add
        </button>
      </form>
    </Modal>
  );
}
