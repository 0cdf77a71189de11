import { createRoot } from "react-dom/client";
import { Editor } from "./Editor";
import { socketTransport } from "./session/socket";

const address = new URL("socket", location.href);
address.protocol = address.protocol.replace("http", "ws");

createRoot(document.getElementById("root")!).render(<Editor transport={socketTransport(address.href)} whole />);
