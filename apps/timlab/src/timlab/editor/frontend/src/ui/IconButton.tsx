import { Icon, type IconName } from "./Icon";

interface Props {
  icon: IconName;
  label: string;
  keys?: string;
  pressed?: boolean;
  disabled?: boolean;
  onClick: () => unknown;
}

export function IconButton({ icon, label, keys, pressed, disabled, onClick }: Props) {
  return (
    <button
      type="button"
      className="icon-button"
      aria-label={label}
      aria-pressed={pressed}
      title={keys ? `${label} (${keys})` : label}
      disabled={disabled}
      onClick={() => void onClick()}
    >
      <Icon name={icon} />
    </button>
  );
}
