import icons from "../../../../diagram/icons.json";

/** Small drawings for types of blocks, in a square of 16: what each does to a signal. */
const TYPES: Record<string, string> = icons.types;
const CATEGORIES: Record<string, string> = icons.categories;

/** The picture of a type of block; one of its heading where it has none of its own. */
export const iconOf = (type: string, category: string): string => TYPES[type] ?? CATEGORIES[category] ?? icons.other;

export function BlockIcon({ type, category }: { type: string; category: string }) {
  return (
    <svg className="block-icon" viewBox="0 0 16 16" aria-hidden="true">
      <path d={iconOf(type, category)} />
    </svg>
  );
}
