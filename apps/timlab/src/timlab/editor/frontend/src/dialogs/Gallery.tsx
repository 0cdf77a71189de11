import { useAsk } from "../session/context";
import { useDocument } from "../session/store";
import { Modal } from "../ui/Modal";
import { prose } from "../ui/prose";
import { enter, openDialog } from "../ui/ui";
import { Thumbnail } from "./Thumbnail";

const GROUPS: [heading: string, learns: boolean][] = [
  ["They learn", true],
  ["Dynamics and control", false],
];

/** Ready diagrams, with what to try in each. */
export function Gallery() {
  const ask = useAsk();
  const gallery = useDocument((document) => document.gallery);
  const open = async (name: string) => {
    openDialog(null);
    if (await ask({ op: "open", gallery: name })) enter([]);
  };
  return (
    <Modal label="Gallery" wide>
      <p className="quiet">Open one, and press play. Opening can be undone.</p>
      {GROUPS.map(([heading, learns]) => (
        <section key={heading} aria-label={heading}>
          <h3>{heading}</h3>
          <div className="cards">
            {gallery
              .filter((each) => each.learns === learns)
              .map(({ name, title, comment, boxes, wires }) => (
                <div key={name} className="card">
                  <Thumbnail boxes={boxes} wires={wires} />
                  <strong>{title || name}</strong>
                  <span>{prose(comment)}</span>
                  <button type="button" aria-label={`Open ${title || name}`} onClick={() => void open(name)}>
                    Open
                  </button>
                </div>
              ))}
          </div>
        </section>
      ))}
    </Modal>
  );
}
