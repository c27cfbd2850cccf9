#include "progressive.h"
