import { type KeyboardEvent, useEffect, useRef, useState } from "react";
import { Modal } from "./Modal";
import { openDialog } from "./ui";

export interface Choice {
  id: string;
  label: string;
  note?: string;
  /** Why it cannot be chosen. */
  refused?: string | null;
  pick: () => unknown;
}

const MOST = 200;

/** A list to choose from by typing: arrows move, Enter chooses. */
export function Picker({ label, choices, hint }: { label: string; choices: Choice[]; hint: string }) {
  const [text, setText] = useState("");
  const [place, setPlace] = useState(0);
  const list = useRef<HTMLUListElement>(null);
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const hits = choices
    .filter((choice) => words.every((word) => choice.label.toLowerCase().includes(word)))
    .slice(0, MOST);
  useEffect(() => {
    list.current?.children[place]?.scrollIntoView({ block: "nearest" });
  }, [place]);
  const pick = (choice: Choice | undefined) => {
    if (!choice || choice.refused) return;
    openDialog(null);
    window.setTimeout(() => void choice.pick(), 0);
  };
  const press = (event: KeyboardEvent) => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) {
      event.preventDefault();
      setPlace((now) => Math.max(0, Math.min(hits.length - 1, now + step)));
    } else if (event.key === "Enter") {
      event.preventDefault();
      pick(hits[place]);
    }
  };
  return (
    <Modal label={label} bare>
      <input
        data-first
        className="picker-input"
        role="combobox"
        aria-label={label}
        aria-expanded
        aria-controls="picker-list"
        aria-activedescendant={`pick-${place}`}
        placeholder={hint}
        value={text}
        onChange={(event) => {
          setText(event.target.value);
          setPlace(0);
        }}
        onKeyDown={press}
      />
      <ul className="picker" id="picker-list" role="listbox" aria-label={label} ref={list}>
        {hits.map((choice, i) => (
          <li
            key={choice.id}
            id={`pick-${i}`}
            role="option"
            aria-selected={i === place}
            aria-disabled={!!choice.refused}
            onMouseMove={() => setPlace(i)}
            onClick={() => pick(choice)}
          >
            <span>{choice.label}</span>
            <small>{choice.refused ?? choice.note}</small>
          </li>
        ))}
        {hits.length === 0 && <li className="quiet">No matches.</li>}
      </ul>
    </Modal>
  );
}
