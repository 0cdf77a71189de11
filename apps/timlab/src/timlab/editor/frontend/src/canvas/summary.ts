import type { BlockView, Declaration, Value } from "../session/types";

const LONGEST = 18;

export function shortly(value: Value): string {
  if (typeof value === "number") return String(Number(value.toPrecision(5)));
  if (Array.isArray(value)) {
    const text = `[${value.map(shortly).join(", ")}]`;
    return text.length > LONGEST ? `${text.slice(0, LONGEST - 1)}…` : text;
  }
  const text = typeof value === "string" ? value : JSON.stringify(value);
  return text.length > LONGEST ? `${text.slice(0, LONGEST - 1)}…` : text;
}

/** What a block's face says of its fields: the first parameter, or the first setting that is a choice. */
export function summary(block: BlockView, declaration: Declaration | undefined): string {
  if (!declaration) return "";
  const field =
    declaration.fields.find(({ role }) => role === "parameter") ??
    declaration.fields.find(({ choices, name }) => choices?.length && name !== "source");
  if (!field) return "";
  const value = block.uses[field.name] ?? block.fields[field.name];
  if (value === undefined || value === null || value === "") return "";
  return field.choices?.length || field.name === "value"
    ? shortly(value)
    : `${field.name.replaceAll("_", " ")} ${shortly(value)}`;
}
