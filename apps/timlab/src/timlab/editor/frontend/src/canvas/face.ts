import type { BlockView, Declaration } from "../session/types";
import { shortly, summary } from "./summary";

/** What a block's face says under its name: a formula, or its first parameter, or its type. */
export interface Face {
  text: string;
  /** Whether the text is a formula or a value rather than the type. */
  value: boolean;
}

const MINUS = "−";
const SIGNS: Record<string, string> = { "+": "+", "-": MINUS, "*": "×", "/": "÷" };

/** What stands at an input in place of its name: the sign with which a sum takes it. */
export function inputLabel(view: BlockView, row: number): string | null {
  const { signs } = view.fields;
  return typeof signs === "string" ? (SIGNS[signs[row] ?? ""] ?? null) : null;
}

/** A formula of a block, if it is one. */
export function formulaOf(view: BlockView): string | null {
  const { expression, relation, operator, how } = view.fields;
  const [first = "u", second = "u"] = view.inputs.map(({ name }) => name);
  if (view.type === "expression") return String(expression).replaceAll("*", "·").replaceAll("-", MINUS);
  if (view.type === "function") return `${String(view.fields.function)}(${first})`;
  if (view.type === "compare") return `${first} ${String(relation)} ${second}`;
  if (view.type === "logic") return String(operator);
  if (view.type === "goto" || view.type === "from") return `[${String(view.fields.tag)}]`;
  if (view.type === "reduce") return `${String(how)}(${first})`;
  return null;
}

export function faceOf(view: BlockView, name: string, declaration: Declaration | undefined): Face {
  const formula = formulaOf(view);
  if (formula !== null) return { text: formula, value: true };
  if (view.type === "diagram") return { text: "subsystem", value: false };
  const named = view.type === name || name.startsWith(`${view.type} `);
  const text = named ? summary(view, declaration) : "";
  return text ? { text, value: true } : { text: named ? "" : view.type, value: false };
}

/** A gain is a triangle with its number. */
export const isTriangle = (view: BlockView): boolean => view.type === "gain";

/** What stands in the triangle. */
export const gainText = (view: BlockView): string =>
  view.uses.gain ?? shortly(view.fields.gain ?? null).replaceAll("-", MINUS);
