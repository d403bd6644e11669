"""What Stable-Baselines3 asks of every vectorised environment, answered for rows of a world."""

from __future__ import annotations

from stable_baselines3.common.vec_env import VecEnv


class RowsEnv(VecEnv):
    """A vectorised environment whose rows have nothing of their own."""

    def close(self) -> None:
        """Do nothing: worlds need no closing."""

    def get_attr(self, attr_name: str, indices: object = None) -> list[object]:
        """Answer what the library asks: rows have no render mode, and nothing else of their own."""
        if attr_name != "render_mode":
            msg = f"rows of an environment have no attribute {attr_name}"
            raise AttributeError(msg)
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: object, indices: object = None) -> None:
        """Refuse: rows have no attributes of their own."""
        msg = f"rows of an environment have no attribute {attr_name}"
        raise AttributeError(msg)

    def env_method(self, method_name: str, *args: object, indices: object = None, **kwargs: object) -> list[object]:
        """Refuse: rows have no methods of their own."""
        msg = f"rows of an environment have no method {method_name}"
        raise AttributeError(msg)

    def env_is_wrapped(self, wrapper_class: type[object], indices: object = None) -> list[bool]:
        """Answer that no row is wrapped."""
        return [False] * self.num_envs
