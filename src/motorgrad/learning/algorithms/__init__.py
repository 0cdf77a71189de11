"""The algorithms, a file each. One line here gives a learner or a preset its name everywhere."""

from motorgrad.learning.algorithms import _advantage_actor_critic as _advantage_actor_critic
from motorgrad.learning.algorithms import _intentional_actor_critic as _intentional_actor_critic
from motorgrad.learning.algorithms import _natural_actor_critic as _natural_actor_critic
from motorgrad.learning.algorithms import _reinforce as _reinforce
from motorgrad.learning.algorithms import _stream_actor_critic as _stream_actor_critic
from motorgrad.learning.algorithms import _trust_region as _trust_region
from motorgrad.learning.algorithms._action_value_gradient import ActionValueGradient as ActionValueGradient
from motorgrad.learning.algorithms._policy_gradient import Agent as Agent
from motorgrad.learning.algorithms._proximal import ProximalPolicyOptimization as ProximalPolicyOptimization
from motorgrad.learning.algorithms._soft_actor_critic import SoftActorCritic as SoftActorCritic
from motorgrad.learning.algorithms._twin_delayed import TwinDelayed as TwinDelayed
