import type { Field, Value } from "../session/types";

/** How a field is filled in. */
export type Form = "choice" | "check" | "number" | "text" | "long" | "data";

export function formOf(field: Field, value: Value): Form {
  if (field.choices?.length) return "choice";
  if (field.role === "parameter") {
    if (Array.isArray(value)) return "data";
    return field.kind === "bool" ? "check" : "number";
  }
  if (field.type === "bool") return "check";
  if (field.name === "comment") return "long";
  if (field.type === "str")
    return typeof value === "string" && (value.includes("\n") || field.name === "settings" || field.name === "xml")
      ? "long"
      : "text";
  if (field.type === "int" || field.type === "float") return "number";
  return "data";
}

/** A value as it is written in a form. */
export function toText(value: Value): string {
  if (value === null || value === undefined || (Array.isArray(value) && !value.length)) return "";
  return typeof value === "string" ? value : written(value);
}

/** A number, or a list of them; 1e-6 rather than 0.000001. */
function written(value: Value): string {
  if (Array.isArray(value)) return `[${value.map((each) => written(each as Value)).join(", ")}]`;
  if (typeof value === "number" && value !== 0 && Math.abs(value) < 1e-3) return value.toExponential();
  return JSON.stringify(value).replaceAll(",", ", ");
}

/** What was written: numbers, lists of them, true, false, null; a list of words may do without brackets and quotes.
 * Throws where it is none of these. */
export function fromText(text: string, field: Field): Value {
  const trimmed = text
    .trim()
    .replace(/^\((.*)\)$/s, "[$1]")
    .replace(/,\s*\]/g, "]");
  if (trimmed === "" || trimmed === "None")
    return field.type.includes("None") ? null : field.type.startsWith("tuple") ? [] : "";
  const special: Record<string, Value> = { True: true, False: false };
  if (trimmed in special) return special[trimmed]!;
  try {
    const value = JSON.parse(trimmed) as Value;
    const listed = field.type.startsWith("tuple") && !Array.isArray(value);
    return listed ? [value] : value;
  } catch {
    if (/^tuple\[(str|typing)/.test(field.type)) return words(trimmed);
    if (field.type.includes("str")) return text;
    if (/^[^[\]]*,/.test(trimmed)) return JSON.parse(`[${trimmed}]`) as Value;
    throw new Error(`${field.name}: must be ${field.allowed ?? "a number, or a list of them as [1, 2]"}`);
  }
}

const words = (text: string): string[] =>
  text
    .replace(/^\[|\]$/g, "")
    .split(",")
    .map((word) => word.trim())
    .filter(Boolean);

/** Between which ends a slider moves: the declared ones, or some about the value. */
export function sliderRange(field: Field, value: number): [number, number] {
  const reach = Math.max(1, 2 * Math.abs(value));
  let low = field.low ?? value - reach;
  let high = field.high ?? (field.low != null ? Math.max(field.low + 1, 2 * value) : value + reach);
  if (field.open) {
    const margin = (high - low) * 1e-3;
    if (field.low != null) low += margin;
    if (field.high != null) high -= margin;
  }
  return [low, high];
}

/** A round step of about a two-hundredth of a range. */
export function stepOf(field: Field, low: number, high: number): number {
  if (field.kind === "int" || field.type === "int") return 1;
  return 10 ** Math.floor(Math.log10((high - low) / 100 || 1));
}
