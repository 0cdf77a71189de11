import { useEffect, useState } from "react";
import { useAsk } from "../session/context";
import { useDocument } from "../session/store";
import type { BlockView, Field, Value } from "../session/types";
import { useUi } from "../ui/ui";
import { FieldRow } from "./FieldRow";

const NUMBER = /(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?/gu;
const NAME = /[\p{L}_][\p{L}\p{N}_]*/gu;

/** The names that a formula reads, in order, without functions and words. */
export function namesIn(formula: string, words: Set<string>): string[] {
  const names = formula.replace(NUMBER, (found, at: number) =>
    /[\p{L}\p{N}_]/u.test(formula[at - 1] ?? "") ? found : " ",
  );
  return [...new Set(names.match(NAME) ?? [])].filter((name) => !words.has(name));
}

const listOf = (value: Value | undefined): string[] => (Array.isArray(value) ? value.map(String) : []);

/** The numbers of constants, one each. */
const numbersOf = (view: BlockView, count: number): number[] => {
  const { numbers } = view.fields;
  return Array.from({ length: count }, (_, i) => Number(Array.isArray(numbers) ? numbers[i] : numbers));
};

/** A formula with its inputs and constants, edited as one: a name that is written becomes an input, and one that is
 * taken out is one no more. */
export function ExpressionForm({ name, path, view }: { name: string; path: string; view: BlockView }) {
  const ask = useAsk();
  const at = useUi((ui) => ui.at);
  const words = useDocument((document) => document.words);
  const reads = listOf(view.fields.reads);
  const constants = listOf(view.fields.constants);
  const numbers = numbersOf(view, constants.length);
  const written = String(view.fields.expression);
  const [text, setText] = useState(written);
  const [wrong, setWrong] = useState(false);
  useEffect(() => {
    setText(written);
    setWrong(false);
  }, [written]);

  const put = async (expression: string, inputs: string[], fixed: [string, number][]) => {
    const fields = {
      expression,
      reads: inputs,
      constants: fixed.map(([each]) => each),
      numbers: fixed.length ? fixed.map(([, value]) => value) : 0,
    };
    setWrong((await ask({ op: "set", at, name, fields })) === null);
  };
  const give = () => {
    if (text === written) return;
    const used = namesIn(text, words).filter((each) => each !== "t" || reads.includes("t"));
    const fixed = constants
      .map((each, i): [string, number] => [each, numbers[i]!])
      .filter(([each]) => used.includes(each));
    const known = new Set([...reads, ...constants]);
    const inputs = [...reads.filter((each) => used.includes(each)), ...used.filter((each) => !known.has(each))];
    void put(text, inputs, fixed);
  };
  const change = (each: string, to: string) => {
    const fixed = constants
      .map((other, i): [string, number] => [other, numbers[i]!])
      .filter(([other]) => other !== each);
    const inputs = reads.filter((other) => other !== each);
    void put(written, to === "input" ? [...inputs, each] : inputs, to === "input" ? fixed : [...fixed, [each, 1]]);
  };
  const tune = async (place: number, value: Value) => {
    const values = numbers.map((number, i) => (i === place ? Number(value) : number));
    return (await ask({ op: "parameter", address: `${path}.numbers`, value: values })) !== null;
  };
  return (
    <>
      <div className="field">
        <label htmlFor="field-expression">formula</label>
        <textarea
          id="field-expression"
          aria-label="expression"
          aria-invalid={wrong}
          rows={Math.min(6, 1 + Math.ceil(text.length / 34))}
          spellCheck={false}
          value={text}
          onChange={(event) => setText(event.target.value)}
          onBlur={give}
          onKeyDown={(event) => {
            if (event.key === "Enter") {
              event.preventDefault();
              give();
            }
            if (event.key === "Escape") setText(written);
          }}
        />
        <p className="help">A new name becomes an input; one that is no longer used goes.</p>
      </div>
      <fieldset>
        <legend>Names</legend>
        {[...reads, ...constants].map((each) => (
          <label key={each} className="name-row">
            <code>{each}</code>
            <select
              aria-label={`${each} is`}
              value={reads.includes(each) ? "input" : "constant"}
              onChange={(event) => change(each, event.target.value)}
            >
              <option value="input">input</option>
              <option value="constant">constant</option>
            </select>
          </label>
        ))}
        {reads.length + constants.length === 0 && <p className="quiet">It reads none.</p>}
      </fieldset>
      {constants.map((each, place) => (
        <FieldRow
          key={`${path}.${each}`}
          field={constantField(each)}
          value={numbers[place]!}
          onSet={(_, value) => tune(place, value)}
        />
      ))}
    </>
  );
}

const constantField = (name: string): Field => ({
  name,
  type: "float",
  role: "parameter",
  kind: "float",
  required: false,
  default: 0,
});

/** The fields that the form shows as one. */
export const AS_ONE = new Set(["expression", "reads", "constants", "numbers"]);
