import { useState } from "react";
import { Modal } from "../ui/Modal";
import { openDialog } from "../ui/ui";

const STEPS: [title: string, text: string][] = [
  [
    "A diagram is blocks and wires",
    "Every block has outputs on its right and inputs on its left. Drag a sine and a scope from the palette to the canvas, or press / and type.",
  ],
  [
    "Draw a wire",
    "Drag from the dot on the right of the sine to the dot on the left of the scope. Matching ports light up; others say why they do not match. With the keyboard: select a block and press C.",
  ],
  [
    "Press play",
    "The space bar runs and pauses. The scope draws below the canvas. The full stop key runs one tick, 0 restarts.",
  ],
  [
    "Change it during a run",
    "Select the sine and move a slider in its form. Nothing is recompiled, and the change can be undone.",
  ],
  [
    "Go back in time",
    "Drag the time slider to the left, change something and press Fork: a new branch begins there, and the scope shows both.",
  ],
  [
    "Take something apart",
    "The gallery has the systems of the thesis, which learn when you press play, and others. Each suggests what to try.",
  ],
];

/** The first steps, one after the other. */
export function Tour() {
  const [step, setStep] = useState(0);
  const [title, text] = STEPS[step]!;
  const final = step === STEPS.length - 1;
  return (
    <Modal label="First steps">
      <div className="tour" aria-live="polite">
        <span className="quiet">
          {step + 1} of {STEPS.length}
        </span>
        <h3>{title}</h3>
        <p>{text}</p>
      </div>
      <footer className="row end">
        <button type="button" className="plain" disabled={step === 0} onClick={() => setStep(step - 1)}>
          Back
        </button>
        <button
          type="button"
          className="primary"
          data-first
          onClick={() => (final ? openDialog("gallery") : setStep(step + 1))}
        >
          {final ? "Open the gallery" : "Next"}
        </button>
      </footer>
    </Modal>
  );
}
