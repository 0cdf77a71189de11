import { useEffect, useState } from "react";
import { useAsk } from "../session/context";
import { Modal } from "../ui/Modal";

/** The diagram as a Python program that builds it. */
export function Python() {
  const ask = useAsk();
  const [text, setText] = useState("");
  useEffect(() => {
    void ask({ op: "text", python: true }).then((answer) => setText(String(answer?.text ?? "")));
  }, [ask]);
  return (
    <Modal label="As Python" wide>
      <pre tabIndex={0}>{text}</pre>
    </Modal>
  );
}
