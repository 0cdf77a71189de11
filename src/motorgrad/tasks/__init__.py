from motorgrad.tasks._task import Task, Reading
from motorgrad.tasks._finite import ThreeState, Chain, CallAdmission
