"""Modules in a row (cfem.predict.serial) as a torch module."""

import numpy as np
import torch
from torch import Tensor, nn

from cfem.surrogate.torch_model import spd_inverse


class Serial(nn.Module):
    """module: of one module, at delta_a (B, n) -> W (B, 6 + n, 6 + n), delta_free (B, 6 + n); softer (k,); module_rest,
    rest (3,) mm: ends at rest of one module and of all."""

    def __init__(self, module: nn.Module, softer: list[float], module_rest: np.ndarray, rest: np.ndarray):
        super().__init__()
        self.module, self.softer = module, softer
        self.register_buffer("module_rest", torch.as_tensor(np.array(module_rest, float)))
        self.register_buffer("rest", torch.as_tensor(np.array(rest, float)))
        self.register_buffer("one", torch.eye(3, dtype=torch.float64))

    def forward(self, s: Tensor) -> tuple[Tensor, Tensor]:
        k = len(self.softer)
        n = s.shape[1] // k
        R, P = self.one[None].expand(s.shape[0], 3, 3), torch.zeros_like(s[:, :3])
        found = []
        for i, softer in enumerate(self.softer):
            each = s[:, i * n : (i + 1) * n]
            W, free = self.module(each)
            lam = spd_inverse(W[:, 6:, 6:]) @ (each - free[:, 6:])[:, :, None]
            end = free[:, :6] + (W[:, :6, 6:] @ lam)[:, :, 0]
            spin = self.cross(end[:, 3:])
            J = self.left_jacobian(end[:, 3:], spin)
            zero = torch.zeros_like(J)
            L = torch.cat([torch.cat([self.one + zero, zero], dim=2), torch.cat([zero, J], dim=2)], dim=1)
            P = P + (R @ (self.module_rest + end[:, :3])[:, :, None])[:, :, 0]
            W = W * softer
            found.append((R, P, L @ W[:, :6, :6] @ L.transpose(1, 2), L @ W[:, :6, 6:], W[:, 6:, 6:], lam / softer))
            R = R @ (self.one + spin @ J)
        W_ee = torch.zeros_like(R)
        pulled, blocks = [], []
        for i, (base, end, own_ee, own_ea, own_aa, _) in enumerate(found):
            arm = base.transpose(1, 2) @ (P - end)[:, :, None]
            T = torch.cat([base, -base @ self.cross(arm[:, :, 0])], dim=2)
            W_ee = W_ee + T @ own_ee @ T.transpose(1, 2)
            pulled.append(T @ own_ea)
            none = torch.zeros_like(own_aa)
            blocks.append(torch.cat([own_aa if j == i else none for j in range(k)], dim=2))
        W_ea = torch.cat(pulled, dim=2)
        W_a = torch.cat([W_ea, torch.cat(blocks, dim=1)], dim=1)
        W = torch.cat([torch.cat([W_ee, W_ea.transpose(1, 2)], dim=1), W_a], dim=2)
        lam = torch.cat([one[5] for one in found], dim=1)
        return W, torch.cat([P - self.rest, s], dim=1) - (W_a @ lam)[:, :, 0]

    def cross(self, v: Tensor) -> Tensor:
        x, y, z, none = v[:, 0], v[:, 1], v[:, 2], torch.zeros_like(v[:, 0])
        return torch.stack([none, -z, y, z, none, -x, -y, x, none], dim=1).reshape(-1, 3, 3)

    def left_jacobian(self, phi: Tensor, spin: Tensor) -> Tensor:
        s = (phi * phi).sum(dim=1)[:, None, None]
        small = s < 1e-4
        safe = torch.where(small, torch.ones_like(s), s)
        t = torch.sqrt(safe)
        a = torch.where(small, 1 / 2 - s / 24 + s * s / 720, (1 - torch.cos(t)) / safe)
        b = torch.where(small, 1 / 6 - s / 120 + s * s / 5040, (t - torch.sin(t)) / (safe * t))
        return self.one + a * spin + b * (spin @ spin)
