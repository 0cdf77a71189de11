import { memo, useEffect, useState } from "react";
import type { Field, Value } from "../session/types";
import { prose } from "../ui/prose";
import { Slider } from "./Slider";
import { formOf, fromText, toText } from "./values";

interface Props {
  field: Field;
  value: Value;
  /** Answers whether it was taken. */
  onSet: (name: string, value: Value) => Promise<boolean>;
  /** What else there is to say of its value. */
  note?: string;
}

/** One field of a block, with its help, unit and range. */
export const FieldRow = memo(function FieldRow({ field, value, onSet, note }: Props) {
  const [text, setText] = useState(toText(value));
  const [wrong, setWrong] = useState<string | null>(null);
  const form = formOf(field, value);
  const written = toText(value);
  useEffect(() => {
    setText(written);
    setWrong(null);
  }, [written]);

  const give = async () => {
    if (text === written) return setWrong(null);
    try {
      const parsed = form === "text" || form === "long" ? text : fromText(text, field);
      if (!(await onSet(field.name, parsed))) setWrong("was not taken");
      else setWrong(null);
    } catch (error) {
      setWrong((error as Error).message);
    }
  };
  const title = field.name.replaceAll("_", " ");
  const id = `field-${field.name}`;
  const hint = [
    field.help && prose(field.help),
    field.unit && `in ${field.unit}`,
    field.role === "parameter" && field.allowed,
  ]
    .filter(Boolean)
    .join("; ");
  const common = { id, "aria-label": field.name, "aria-invalid": !!wrong, title: hint };
  const keys = (event: React.KeyboardEvent) => {
    if (event.key === "Enter" && !(form === "long" && !event.ctrlKey)) void give();
    if (event.key === "Escape") {
      setText(written);
      (event.target as HTMLElement).blur();
    }
  };
  return (
    <div className="field">
      <label htmlFor={id}>
        {title}
        {field.unit && <span className="unit">{field.unit}</span>}
      </label>
      {form === "choice" ? (
        <select {...common} value={text} onChange={(event) => void onSet(field.name, event.target.value)}>
          {field.choices!.map((choice) => (
            <option key={choice}>{choice}</option>
          ))}
        </select>
      ) : form === "check" ? (
        <input
          {...common}
          type="checkbox"
          checked={value === true}
          onChange={(event) => void onSet(field.name, event.target.checked)}
        />
      ) : form === "long" || (form === "data" && text.length > 28) ? (
        <textarea
          {...common}
          rows={Math.min(10, 2 + text.split("\n").length)}
          spellCheck={false}
          value={text}
          onChange={(event) => setText(event.target.value)}
          onBlur={() => void give()}
          onKeyDown={keys}
        />
      ) : (
        <input
          {...common}
          type="text"
          inputMode={form === "number" ? "decimal" : "text"}
          spellCheck={false}
          autoComplete="off"
          value={text}
          placeholder={field.name === "shape" ? "one number" : "none"}
          onChange={(event) => setText(event.target.value)}
          onBlur={() => void give()}
          onKeyDown={keys}
        />
      )}
      {field.role === "parameter" && typeof value === "number" && form === "number" && (
        <Slider field={field} value={value} onSet={(next) => void onSet(field.name, next)} />
      )}
      {field.help && <p className="help">{prose(field.help)}</p>}
      {note && <p className="note">{note}</p>}
      {wrong && (
        <p className="mistake" role="alert">
          {wrong}
        </p>
      )}
    </div>
  );
});
