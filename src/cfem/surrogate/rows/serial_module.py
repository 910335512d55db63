"""Modules in a row (cfem.predict.rows.serial) as a torch module."""

import numpy as np
import torch
from torch import Tensor, nn

from cfem.predict.rows.serial import END, SerialPredictor
from cfem.surrogate.torch_model import spd_inverse


class Serial(nn.Module):
    """Torch module of modules in a row. models: of the modules, each at delta_a (B, n) -> W (B, p + n, p + n),
    delta_free (B, p + n), p of 6 or 9 rows; row: what they make up."""

    def __init__(self, models: list[nn.Module], row: SerialPredictor):
        """Takes over what the row knows of its modules."""
        super().__init__()
        self.models = nn.ModuleList([models[number] for number in row.which])
        self.softer, self.heavy, self.pose = row.softer.tolist(), row.heavy, row.pose
        self.columns = [(columns.start, columns.stop) for columns in row.columns]
        self.watched = [module.rows.n_e for module in row.modules]
        self.shares = row.shares.tolist()
        self.register_buffer("rests", torch.as_tensor(row.rests))
        self.register_buffer("rest", torch.as_tensor(np.array(row.rest_e)))
        self.register_buffer("one", torch.eye(3, dtype=torch.float64))

    def forward(self, s: Tensor) -> tuple[Tensor, Tensor]:
        """W and delta_free of the row at s (B, n_a), as `SerialPredictor.learned`: base by base, then the effectors'
        motion with each module."""
        k, p = len(self.softer), self.pose
        R, P = self.one[None].expand(s.shape[0], 3, 3), torch.zeros_like(s[:, :1]).expand(s.shape[0], 3)
        placed, centres = [], []
        for i, model in enumerate(self.models):
            s_module, n_e, softer = s[:, self.columns[i][0] : self.columns[i][1]], self.watched[i], self.softer[i]
            W, free = model(s_module)
            lam = spd_inverse(W[:, n_e:, n_e:]) @ (s_module - free[:, n_e:])[:, :, None]
            pose = free[:, :p] + (W[:, :p, n_e:] @ lam)[:, :, 0]
            spin = self.cross(pose[:, 3:END])
            J = self.left_jacobian(pose[:, 3:END], spin)
            L = self.diagonal(J)
            if self.heavy:
                centres.append(P + (R @ (self.rests[i, END:] + pose[:, END:])[:, :, None])[:, :, 0])
            P = P + (R @ (self.rests[i, :3] + pose[:, :3])[:, :, None])[:, :, 0]
            W = W * softer
            own_ee, own_ea = L @ W[:, :p, :p] @ L.transpose(1, 2), L @ W[:, :p, n_e:]
            placed.append((R, P, own_ee, own_ea, W[:, n_e:, n_e:], lam / softer))
            R = R @ (self.one + spin @ J)
        place = torch.cat([P, self.mean(centres, P)], dim=1) if self.heavy else P
        W_ee = torch.zeros_like(place[:, :, None] * place[:, None, :])
        pulled, blocks = [], []
        for i, (base, end, own_ee, own_ea, own_aa, _) in enumerate(placed):
            T = self.moving(base, P - end, 1.0, 0.0)
            if self.heavy:
                arm = torch.zeros_like(P)
                for j in range(i + 1, k):
                    arm = arm + self.shares[j] * (centres[j] - end)
                T = torch.cat([T, self.moving(base, arm, sum(self.shares[i + 1 :]), self.shares[i])], dim=1)
            W_ee = W_ee + T @ own_ee @ T.transpose(1, 2)
            pulled.append(T @ own_ea)
            row = [own_aa if j == i else torch.zeros_like(own_aa[:, :, :1]).expand(-1, -1, stop - start)
                   for j, (start, stop) in enumerate(self.columns)]  # fmt: skip
            blocks.append(torch.cat(row, dim=2))
        W_ea = torch.cat(pulled, dim=2)
        W_a = torch.cat([W_ea, torch.cat(blocks, dim=1)], dim=1)
        W = torch.cat([torch.cat([W_ee, W_ea.transpose(1, 2)], dim=1), W_a], dim=2)
        lam = torch.cat([values[5] for values in placed], dim=1)
        return W, torch.cat([place - self.rest, s], dim=1) - (W_a @ lam)[:, :, 0]

    def mean(self, centres: list[Tensor], like: Tensor) -> Tensor:
        total = torch.zeros_like(like)
        for share, centre in zip(self.shares, centres, strict=True):
            total = total + share * centre
        return total

    def moving(self, base: Tensor, arm: Tensor, end: float, centre: float) -> Tensor:
        """Motion (B, 3, p) of a place with a module's rows: `end` of its end and, by spins, of the arm from there,
        `centre` of its centre of mass."""
        turned = -base @ self.cross((base.transpose(1, 2) @ arm[:, :, None])[:, :, 0])
        return torch.cat([end * base, turned] + ([centre * base] if self.heavy else []), dim=2)

    def diagonal(self, J: Tensor) -> Tensor:
        """Matrix (B, p, p): the identity, but J where rotation vectors become spins."""
        identity, zero = self.one + torch.zeros_like(J), torch.zeros_like(J)
        blocks = [identity, J, identity] if self.heavy else [identity, J]
        rows = [torch.cat([block if j == i else zero for j in range(len(blocks))], dim=2)
                for i, block in enumerate(blocks)]  # fmt: skip
        return torch.cat(rows, dim=1)

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
