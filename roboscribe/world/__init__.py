"""The robot's world as an EFMDP (Sec. 3): objects, attributes, batched states, trajectories, tasks."""

from roboscribe.world.layout import Attribute, Layout, ObjectType
from roboscribe.world.task import Task, World
from roboscribe.world.trajectory import Trajectory

__all__ = ["Attribute", "Layout", "ObjectType", "Task", "Trajectory", "World"]
