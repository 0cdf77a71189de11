import { useEffect, useState } from "react";
import { useUi } from "./ui";

/** Whether dark colours are shown: as chosen, or as the system prefers. */
export function useDark(): boolean {
  const theme = useUi((ui) => ui.theme);
  const [system, setSystem] = useState(() => matchMedia("(prefers-color-scheme: dark)").matches);
  useEffect(() => {
    const query = matchMedia("(prefers-color-scheme: dark)");
    const change = () => setSystem(query.matches);
    query.addEventListener("change", change);
    return () => query.removeEventListener("change", change);
  }, []);
  return theme === "dark" || (theme === "system" && system);
}
