import { type RefObject, useEffect, useState } from "react";

/** How large an element is, as it changes. */
export function useSize(element: RefObject<HTMLElement | null>): { width: number; height: number } {
  const [size, setSize] = useState({ width: 0, height: 0 });
  useEffect(() => {
    const own = element.current;
    if (!own) return;
    const observer = new ResizeObserver(() => {
      const next = { width: Math.floor(own.clientWidth), height: Math.floor(own.clientHeight) };
      setSize((before) => (before.width === next.width && before.height === next.height ? before : next));
    });
    observer.observe(own);
    return () => observer.disconnect();
  }, [element]);
  return size;
}
