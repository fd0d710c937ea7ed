"""bf16 is taken on a card that computes in it, and not on one that imitates it."""

import pytest
import torch

from policies.networks import precision


@pytest.mark.parametrize("on_processor", [False, True])
@pytest.mark.parametrize("on_card", [False, True])
def test_a_card_computes_in_bf16_only_where_it_does_so_itself(
    monkeypatch: pytest.MonkeyPatch, on_card: bool, on_processor: bool
) -> None:
    monkeypatch.setattr(precision, "has_fast_bf16", lambda: on_processor)
    monkeypatch.setattr(torch.cuda, "is_bf16_supported", lambda including_emulation=True: including_emulation or on_card)

    assert precision.precision_of("cuda:0") == (torch.bfloat16 if on_card else torch.float32)
    assert precision.precision_of("cpu") == (torch.bfloat16 if on_processor else torch.float32)
