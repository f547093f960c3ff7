"""The detector-segmenter: people's boxes, scores and masks in a picture of 320 x 192.

A small network of YOLOv8-seg's kind: a residual trunk down to 1/32, features of all scales joined
on the way up, one anchor-free head for each of the grids of 8, 16 and 32 pixels, and prototypes of
masks at 1/4 (YOLACT). Its outputs are those of YOLOv8-seg's published export.
"""

import torch
from torch import nn
from torch.nn import functional as F

WIDTH, HEIGHT = 320, 192
STRIDES = (8, 16, 32)
PROTOTYPES = 8


def conv(cin, cout, size=3, stride=1):
    return nn.Sequential(
        nn.Conv2d(cin, cout, size, stride, size // 2, bias=False), nn.BatchNorm2d(cout), nn.ReLU(True)
    )


class Residual(nn.Module):
    def __init__(self, channels):
        super().__init__()
        self.body = nn.Sequential(conv(channels, channels // 2), conv(channels // 2, channels))

    def forward(self, x):
        return x + self.body(x)


class Detector(nn.Module):
    def __init__(self, widths=(12, 24, 40, 64, 72), joined=48):
        super().__init__()
        self.stem = conv(3, widths[0], stride=2)
        steps = zip(widths, widths[1:])
        self.trunk = nn.ModuleList(nn.Sequential(conv(a, b, stride=2), Residual(b)) for a, b in steps)
        self.lateral = nn.ModuleList(conv(w, joined, 1) for w in widths[2:])
        self.head = nn.ModuleList(conv(joined, joined) for _ in STRIDES)
        self.out = nn.ModuleList(nn.Conv2d(joined, 5 + PROTOTYPES, 1) for _ in STRIDES)
        for out in self.out:
            nn.init.constant_(out.bias[4], -4.0)
            nn.init.constant_(out.bias[:4], 0.7)
        self.fine = conv(widths[1], 24, 1)
        self.coarse = conv(joined, 24, 1)
        self.prototypes = nn.Sequential(conv(24, 24), nn.Conv2d(24, PROTOTYPES, 1))
        self.register_buffer("centres", places(), persistent=False)
        self.register_buffer("strides", strides(), persistent=False)

    def forward(self, x):
        """Boxes [n, 4, places] (left, top, right, bottom), score logits, recipes, prototypes."""
        levels, x = [], self.stem(x)
        for stage in self.trunk:
            x = stage(x)
            levels.append(x)
        fine, levels = levels[0], levels[1:]
        joined = [lateral(level) for lateral, level in zip(self.lateral, levels)]
        for i in (1, 0):
            joined[i] = joined[i] + F.interpolate(joined[i + 1], scale_factor=2.0, mode="nearest")
        up = F.interpolate(self.coarse(joined[0]), scale_factor=2.0, mode="nearest")
        prototypes = self.prototypes(self.fine(fine) + up)
        answers = [out(head(j)).flatten(2) for out, head, j in zip(self.out, self.head, joined)]
        answer = torch.cat(answers, 2)
        sides = F.softplus(answer[:, :4]) * self.strides
        boxes = torch.cat([self.centres - sides[:, :2], self.centres + sides[:, 2:]], 1)
        return boxes, answer[:, 4], answer[:, 5:], prototypes


def places():
    """Middles of all grids' cells, [1, 2, places], pixels of the input."""
    grids = []
    for s in STRIDES:
        y, x = torch.meshgrid(torch.arange(HEIGHT // s), torch.arange(WIDTH // s), indexing="ij")
        grids.append((torch.stack([x, y]).flatten(1) + 0.5) * s)
    return torch.cat(grids, 1)[None]


def strides():
    return torch.cat([torch.full((WIDTH * HEIGHT // s**2,), float(s)) for s in STRIDES])[None, None]


class Export(nn.Module):
    """The network with YOLOv8-seg's outputs: middles and sizes, scores, recipes; prototypes."""

    def __init__(self, network):
        super().__init__()
        self.network = network

    def forward(self, images):
        boxes, scores, recipes, prototypes = self.network(images)
        low, high = boxes[:, :2], boxes[:, 2:]
        rows = [(low + high) / 2, high - low, scores[:, None].sigmoid(), recipes]
        return torch.cat(rows, 1), prototypes


def iou(a, b, generalised=False):
    """Of boxes [..., 4]; the generalised one tells boxes that do not meet apart as well."""
    low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
    area = lambda low, high: (high - low).clamp(min=0).prod(-1)
    both = area(low, high)
    union = area(a[..., :2], a[..., 2:]) + area(b[..., :2], b[..., 2:]) - both
    ratio = both / union.clamp(min=1e-6)
    if not generalised:
        return ratio
    hull = area(torch.minimum(a[..., :2], b[..., :2]), torch.maximum(a[..., 2:], b[..., 2:]))
    return ratio - (hull - union) / hull.clamp(min=1e-6)


@torch.no_grad()
def assign(boxes, scores, truth, there, centres, best=8):
    """Which place answers for whom: those within the box whose score and box agree best with it
    (Feng et al. 2021, TOOD). `truth` [n, people, 4], `there` [n, people]. Out: the person's number
    for each place, -1 for none, and the score it should have."""
    overlap = iou(boxes[:, None], truth[:, :, None])  # n, people, places
    c = centres[0].T[None, None]
    inside = ((c > truth[:, :, None, :2]) & (c < truth[:, :, None, 2:])).all(-1)
    # A box that holds no middle of a cell is answered for by the nearest.
    far = (c - (truth[..., :2] + truth[..., 2:])[:, :, None] / 2).norm(dim=-1)
    nearest = far <= far.min(-1, keepdim=True).values
    may = (inside | (nearest & ~inside.any(-1, keepdim=True))) & there[..., None]
    agreement = (scores.sigmoid()[:, None].sqrt() * overlap**6 + 1e-9) * may
    least = agreement.topk(best, -1).values[..., -1:]
    chosen = may & (agreement >= least)
    # Who is claimed by several answers for the one it fits best.
    person = torch.where(chosen, overlap + 1e-6, -1.0).max(1)
    owner = torch.where(person.values > 0, person.indices, -1)
    own = torch.where(owner[:, None] == torch.arange(truth.shape[1])[None, :, None], agreement, 0.0)
    most = own.amax(-1, keepdim=True).clamp(min=1e-9)
    fit = torch.where(own > 0, overlap, 0.0).amax(-1, keepdim=True)
    return owner, (own / most * fit).amax(1)


def loss(answer, truth, there, ignored, masks, centres):
    """`masks` [n, rows, columns]: at 1/2, the number of who is seen, from 1. `ignored` [n, people,
    4]: boxes of those too little seen to be asked for; nothing is learned about places in them."""
    boxes, scores, recipes, prototypes = answer
    boxes = boxes.transpose(1, 2)
    owner, wanted = assign(boxes, scores, truth, there, centres)
    c = centres[0].T[None, None]
    in_ignored = ((c > ignored[:, :, None, :2]) & (c < ignored[:, :, None, 2:])).all(-1).any(1)
    total = wanted.sum().clamp(min=1.0)
    weight = torch.where(in_ignored & (owner < 0), 0.0, 1.0)
    # Sure of nobody costs by how sure (focal), sure of somebody by how good the box is.
    p = scores.sigmoid()
    weight = weight * torch.where(wanted > 0, 1.0, 0.75 * p.detach() ** 1.5 + 0.02)
    score_loss = (weight * F.binary_cross_entropy_with_logits(scores, wanted, reduction="none")).sum() / total

    image, place = torch.nonzero(owner >= 0, as_tuple=True)
    if len(image) == 0:
        return score_loss, score_loss.detach() * 0, score_loss.detach() * 0
    who = owner[image, place]
    target = truth[image, who]
    w = wanted[image, place]
    box_loss = (w * (1 - iou(boxes[image, place], target, generalised=True))).sum() / total

    keep = torch.randperm(len(image))[:96]
    image, place, who, target = image[keep], place[keep], who[keep], target[keep]
    sums = torch.einsum("nk,nkyx->nyx", recipes[image, :, place], prototypes[image])
    sums = F.interpolate(sums[:, None], scale_factor=2.0, mode="bilinear", align_corners=False)[:, 0]
    inside = (masks[image] == (who + 1)[:, None, None]).float()
    y = (torch.arange(sums.shape[1]) + 0.5) * 2
    x = (torch.arange(sums.shape[2]) + 0.5) * 2
    t = target[:, :, None]
    within = ((y > t[:, 1]) & (y < t[:, 3]))[:, :, None] & ((x > t[:, 0]) & (x < t[:, 2]))[:, None]
    pixel = F.binary_cross_entropy_with_logits(sums, inside, reduction="none") * within
    mask_loss = (pixel.sum((1, 2)) / within.sum((1, 2)).clamp(min=1)).mean()
    return score_loss, box_loss, mask_loss
