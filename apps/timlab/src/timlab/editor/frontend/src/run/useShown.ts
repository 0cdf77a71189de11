import { useMemo } from "react";
import { useRun } from "../session/store";

/** The branches that scopes show: the present one last, over the others that it is compared with. */
export function useShown(compare: boolean): string[] {
  const branch = useRun((run) => run.branch);
  const branches = useRun((run) => run.branches);
  return useMemo(() => {
    const others = compare ? branches.map(({ name }) => name).filter((name) => name !== branch) : [];
    return branch === null ? [] : [...others, branch];
  }, [branches, branch, compare]);
}
