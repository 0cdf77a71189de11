"""Studies: tasks × settings × seeds on one machine or many, each job a run directory."""

from motorgrad.studies._driver import EXECUTORS, On, drive, run_study
from motorgrad.studies._jobs import AnyJob, JobFolder, Outcome, Work
from motorgrad.studies._page import broken_text, settings_text
from motorgrad.studies._partition import Job
from motorgrad.studies._plan import Design
from motorgrad.studies._results import Best, Results
from motorgrad.studies._scores import ScoreEach
from motorgrad.studies._search import Search, SearchResults
from motorgrad.studies._study import Study
from motorgrad.studies.comparison._comparison import Comparison, compare
from motorgrad.studies.comparison._plan import JudgedTask, Seeds
from motorgrad.studies.comparison._results import ComparisonResults

__all__ = [
    "EXECUTORS",
    "AnyJob",
    "Best",
    "Comparison",
    "ComparisonResults",
    "Design",
    "Job",
    "JobFolder",
    "JudgedTask",
    "On",
    "Outcome",
    "Results",
    "ScoreEach",
    "Search",
    "SearchResults",
    "Seeds",
    "Study",
    "Work",
    "broken_text",
    "compare",
    "drive",
    "run_study",
    "settings_text",
]
