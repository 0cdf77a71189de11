import { type ReactNode, useEffect, useRef } from "react";
import { focused } from "./root";
import { useUi } from "./ui";
import { IconButton } from "./IconButton";
import { Toasts } from "./Toasts";

/** A window over the editor. Escape, and a click beside it, close it. What is told meanwhile stands in front of it. */
export function Modal({
  label,
  children,
  wide,
  bare,
}: {
  label: string;
  children: ReactNode;
  wide?: boolean;
  bare?: boolean;
}) {
  const own = useRef<HTMLDialogElement>(null);
  useEffect(() => {
    const dialog = own.current;
    const before = focused();
    dialog?.showModal();
    dialog?.querySelector<HTMLElement>("[data-first]")?.focus();
    return () => before?.focus?.();
  }, []);
  return (
    <dialog
      ref={own}
      className={`modal ${wide ? "wide" : ""}`}
      aria-label={label}
      onClose={() => useUi.setState({ dialog: null, adding: null })}
      onKeyDown={(event) => event.stopPropagation()}
      onClick={(event) => event.target === own.current && own.current?.close()}
    >
      <div className="modal-body">
        {!bare && (
          <header>
            <h2>{label}</h2>
            <IconButton icon="close" label="Close" onClick={() => own.current?.close()} />
          </header>
        )}
        {children}
      </div>
      <Toasts />
    </dialog>
  );
}
