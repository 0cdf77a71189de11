import { createRoot } from "react-dom/client";
import { Editor } from "./Editor";
import { type Recording, recordingTransport } from "./session/recording";
import { useDocument } from "./session/store";
import { useUi } from "./ui/ui";

// A diagram with its run in one file, without a server: the editor over what was recorded.
const recording = JSON.parse(document.getElementById("recording")!.textContent!) as Recording;
useDocument.setState({ recorded: true });
useUi.setState({ palette: false });
createRoot(document.getElementById("root")!).render(<Editor transport={recordingTransport(recording)} whole />);
