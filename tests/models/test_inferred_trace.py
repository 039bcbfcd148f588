"""Inferred Trace: a way that is no way says nothing, and the policy can learn."""

from dataclasses import replace

import torch

from evaps.models.inferred_trace import STOP, InferredTrace, InferredTraceConfig, Policy, Ways

SMALL = InferredTraceConfig(feature=32, pair=64, hidden=64, dropout=0.0)


def some_ways(tasks: int, time: int = 6) -> Ways:
    lengths = torch.randint(1, time + 1, (tasks, 5))
    real = torch.arange(time) < lengths[..., None]
    actions = torch.randint(0, STOP, (tasks, 5, time))
    actions[torch.arange(time) >= lengths[..., None] - 1] = STOP
    seen = torch.randn(tasks, 5, time, 32)
    return Ways(seen, torch.rand(tasks, 5, time, 6).round(), actions, real, torch.randn(tasks, 5, 32))


def test_of_a_way_that_missed_its_goal_only_the_pair_counts() -> None:
    torch.manual_seed(0)
    net = InferredTrace(SMALL).eval()
    ways = some_ways(2)
    missed = replace(ways, real=torch.zeros_like(ways.real))
    elsewhere = missed.seen.clone()
    elsewhere[:, :, 1:] += 1
    tokens = torch.randint(1, 9, (2, 7))
    one = net.logits(missed, tokens)
    other = net.logits(replace(missed, seen=elsewhere, actions=torch.zeros_like(ways.actions)), tokens)
    torch.testing.assert_close(one, other)
    assert not torch.allclose(net.logits(ways, tokens), one)


def test_padding_of_ways_changes_nothing() -> None:
    torch.manual_seed(0)
    net = InferredTrace(SMALL).eval()
    ways = some_ways(3)
    names = {"seen": 0.5, "perceived": 1.0, "actions": STOP, "real": False}
    pads = {k: (0, 0, 0, 4) if getattr(ways, k).dim() == 4 else (0, 4) for k in names}
    longer = {k: torch.nn.functional.pad(getattr(ways, k), pads[k], value=v) for k, v in names.items()}
    tokens = torch.randint(1, 9, (3, 7))
    torch.testing.assert_close(net.logits(ways, tokens), net.logits(replace(ways, **longer), tokens))
    torch.testing.assert_close(net.policy.loss(ways), net.policy.loss(replace(ways, **longer)))


def test_the_policy_says_the_same_on_the_way_as_of_a_whole_way() -> None:
    torch.manual_seed(0)
    policy, ways = Policy(SMALL).eval(), some_ways(2)
    seen, perceived, goal, last = (
        x.flatten(0, 1) for x in (ways.seen, ways.perceived, ways.goal, torch.randint(STOP, (2, 5, 6)))
    )
    hidden, logits = policy.start(len(goal)), []
    for time in range(seen.shape[1]):
        decided, hidden = policy.step(seen[:, time], perceived[:, time], goal, last[:, time], hidden)
        logits.append(decided)
    torch.testing.assert_close(torch.stack(logits, 1), policy(seen, perceived, goal, last))


def test_the_policy_can_learn_ways_by_heart() -> None:
    torch.manual_seed(0)
    policy, ways = Policy(SMALL), some_ways(16)
    optimizer = torch.optim.Adam(policy.parameters(), lr=3e-3)
    for _ in range(120):
        loss, right = policy.loss(ways)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        if right >= 0.99:
            return
    raise AssertionError(f"only {right:.2f} of the actions are right")
