"""The solid of each body of the catalogue, by the type of its geometry."""

from cfem.robot.catalogue.bar import Bar, bar
from cfem.robot.catalogue.bellows import Bellows, bellows
from cfem.robot.catalogue.diamond import Diamond, diamond
from cfem.robot.catalogue.fin_ray import FinRay, fin_ray
from cfem.robot.catalogue.pneunet import PneuNet, pneunet
from cfem.robot.catalogue.pneunet_trunk import PneuNetTrunk, pneunet_trunk
from cfem.robot.catalogue.soft_finger import SoftFinger, soft_finger
from cfem.robot.catalogue.taper import Taper, taper
from cfem.robot.catalogue.trunk import Trunk, trunk
from cfem.robot.catalogue.tube import Tube, tube

CATALOGUE = {
    Bar: bar,
    Bellows: bellows,
    Diamond: diamond,
    FinRay: fin_ray,
    PneuNet: pneunet,
    PneuNetTrunk: pneunet_trunk,
    SoftFinger: soft_finger,
    Taper: taper,
    Trunk: trunk,
    Tube: tube,
}
