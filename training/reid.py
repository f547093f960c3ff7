"""The re-identification network: what somebody looks like, as 96 numbers that point one way.

A small residual network with IBN-a blocks (Pan et al. 2018): in all but the last stage half of the
first convolution's channels are normalised picture by picture, which takes the light off, and half
over all pictures, which keeps the colours. Features are taken behind the batch normalisation that
parts the two losses (Luo et al. 2019).
"""

import torch
from torch import nn
from torch.nn import functional as F

WIDTH, HEIGHT = 64, 128
WIDTHS = (16, 24, 40, 64, 96)


class Ibn(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.half = channels // 2
        self.single = nn.InstanceNorm2d(self.half, affine=True)
        self.all = nn.BatchNorm2d(channels - self.half)

    def forward(self, x):
        return torch.cat([self.single(x[:, : self.half]), self.all(x[:, self.half :])], 1)


class Block(nn.Module):
    def __init__(self, cin, cout, stride, ibn):
        super().__init__()
        self.first = nn.Sequential(
            nn.Conv2d(cin, cout, 3, stride, 1, bias=False), Ibn(cout) if ibn else nn.BatchNorm2d(cout), nn.ReLU(True)
        )
        self.second = nn.Sequential(nn.Conv2d(cout, cout, 3, 1, 1, bias=False), nn.BatchNorm2d(cout))
        self.past = nn.Sequential(nn.Conv2d(cin, cout, 1, stride, bias=False), nn.BatchNorm2d(cout))

    def forward(self, x):
        return F.relu(self.past(x) + self.second(self.first(x)))


class ReId(nn.Module):
    def __init__(self, identities=1):
        super().__init__()
        w = WIDTHS
        self.stem = nn.Sequential(nn.Conv2d(3, w[0], 3, 2, 1, bias=False), nn.BatchNorm2d(w[0]), nn.ReLU(True))
        strides = (2, 2, 2, 1)
        self.stages = nn.Sequential(*(Block(w[i], w[i + 1], s, i < 3) for i, s in enumerate(strides)))
        self.neck = nn.BatchNorm1d(w[-1])
        nn.init.zeros_(self.neck.bias)
        self.neck.bias.requires_grad_(False)
        self.identity = nn.Linear(w[-1], identities, bias=False)

    def forward(self, x):
        """The feature before the neck, for distances between pictures, and the one behind it."""
        pooled = self.stages(self.stem(x)).mean((2, 3))
        return pooled, self.neck(pooled)


class Export(nn.Module):
    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, crops):
        return F.normalize(self.network(crops)[1], dim=1)


def triplet(features, identities, margin=0.3):
    """Each picture's hardest: the farthest of the same person against the nearest of others
    (Hermans et al. 2017)."""
    distances = torch.cdist(features, features)
    same = identities[:, None] == identities[None]
    farthest = torch.where(same, distances, 0.0).amax(1)
    nearest = torch.where(same, 1e9, distances).amin(1)
    return F.relu(farthest - nearest + margin).mean()
