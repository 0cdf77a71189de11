"""How commands read their options, from the line and from files, and print and write what they found.

A command is a frozen dataclass of its options and a function of the words of the line:

    options = parse(Options, arguments, "name")

`executors` has the options that say where the jobs of a study run; it is not imported here, as few commands have jobs.
"""

from motorgrad.options._configuration import ASKED, Arguments, naming, parse, pop_option, read_arguments, resolve
from motorgrad.options._line import HELP, HELP_ALL
from motorgrad.options._outputs import MARK, OUTPUTS
from motorgrad.options._results import (
    failure_text,
    finite_table,
    json_help,
    listed_failures,
    print_outcome,
    print_place,
    summary,
    summary_text,
    write_json,
)
from motorgrad.options._task_options import changes_from_task, command_with_learner, is_task_word, split_task

__all__ = [
    "ASKED",
    "HELP",
    "HELP_ALL",
    "MARK",
    "OUTPUTS",
    "Arguments",
    "changes_from_task",
    "command_with_learner",
    "failure_text",
    "finite_table",
    "is_task_word",
    "json_help",
    "listed_failures",
    "naming",
    "parse",
    "pop_option",
    "print_outcome",
    "print_place",
    "read_arguments",
    "resolve",
    "split_task",
    "summary",
    "summary_text",
    "write_json",
]
