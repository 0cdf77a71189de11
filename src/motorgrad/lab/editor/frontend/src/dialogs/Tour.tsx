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
    "Pull from the dot at the sine's right to the dot at the scope's left. What fits lights up; what does not says why. With the keyboard: select a block and press C.",
  ],
  [
    "Press play",
    "The space bar runs and pauses. The scope draws below the canvas. The full stop makes one tick, 0 begins again.",
  ],
  [
    "Turn it while it runs",
    "Select the sine and move a slider in its form. Nothing is compiled again, and undo takes it back.",
  ],
  [
    "Go back in time",
    "Pull the time slider to the left, change something and press Fork: a new branch begins there, and the scope shows both.",
  ],
  [
    "Take something apart",
    "The gallery has the systems of the thesis. Each learns when you press play, and says what to try.",
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
