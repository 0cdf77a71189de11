import { memo, useEffect, useRef } from "react";
import { DRAGGED } from "../canvas/useDropped";
import type { Declaration } from "../session/types";
import { BlockIcon } from "../ui/BlockIcon";
import { hueOf } from "../ui/category";
import { prose } from "../ui/prose";

interface Props {
  declaration: Declaration;
  chosen: boolean;
  onAdd: (type: string) => void;
}

/** One type of block in the palette. */
export const PaletteItem = memo(function PaletteItem({ declaration, chosen, onAdd }: Props) {
  const { name, category, help } = declaration;
  const own = useRef<HTMLButtonElement>(null);
  useEffect(() => {
    if (chosen) own.current?.scrollIntoView({ block: "nearest" });
  }, [chosen]);
  return (
    <button
      ref={own}
      type="button"
      className={`palette-item ${chosen ? "chosen" : ""}`}
      style={{ "--hue": hueOf(category) } as React.CSSProperties}
      draggable
      title={prose(help)}
      aria-label={`Add ${label(name)}`}
      onClick={() => onAdd(name)}
      onDragStart={(event) => {
        event.dataTransfer.setData(DRAGGED, name);
        event.dataTransfer.effectAllowed = "copy";
      }}
    >
      <BlockIcon type={name} category={category} />
      {label(name)}
    </button>
  );
});

/** A diagram as a block is a subsystem. */
export const label = (type: string): string => (type === "diagram" ? "subsystem" : type);
