"""Our loop around torch's update does what torch's optimizer does, and loads less."""

from __future__ import annotations

import subprocess
import sys

import torch

from roboscribe.rl.adam import Adam
from roboscribe.rl.torch_net import mlp

STEPS = 20


def _loss(network: torch.nn.Module, step: int) -> torch.Tensor:
    inputs = torch.randn(32, 3, generator=torch.Generator().manual_seed(step))
    return torch.nn.functional.mse_loss(network(inputs), inputs.sum(dim=1, keepdim=True))


def test_updates_are_those_of_torchs_optimizer_and_schedule() -> None:
    ours, theirs = mlp([3, 8, 1]), mlp([3, 8, 1])
    theirs.load_state_dict(ours.state_dict())
    own = Adam(ours, 0.01, STEPS)
    optimizer = torch.optim.Adam(theirs.parameters(), lr=0.01, fused=True)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, STEPS)
    for step in range(STEPS):
        torch.autograd.backward(_loss(ours, step))
        own.step()
        optimizer.zero_grad()
        torch.autograd.backward(_loss(theirs, step))
        optimizer.step()
        schedule.step()
    for mine, reference in zip(ours.parameters(), theirs.parameters(), strict=True):
        torch.testing.assert_close(mine, reference, rtol=1e-5, atol=1e-7)
        assert mine.grad is None


def test_an_update_does_not_load_the_compiler() -> None:
    code = (
        "import sys, torch; from roboscribe.rl.adam import Adam; from roboscribe.rl.torch_net import mlp\n"
        "network = mlp([2, 1]); torch.autograd.backward(network(torch.ones(1, 2)).sum())\n"
        "Adam(network, 0.1, 1).step(); print('torch._dynamo' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
